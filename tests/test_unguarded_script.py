"""A script that starts a run without a main guard."""

import subprocess
import sys


def test_a_script_without_a_guard_is_told_so_by_one_error(tmp_path):
    script = tmp_path / "script.py"
    out = tmp_path / "out"
    script.write_text(
        "import fastgen\n"
        "settings = fastgen.RenderSettings(size=(64, 64), quality='draft')\n"
        f"fastgen.generate(fastgen.Job({str(out)!r}, images=8, render=settings), 2)\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True)
    assert done.returncode == 1
    *_, last = done.stderr.splitlines()
    assert last.startswith("fastgen.errors.OutputError: generate: worker processes import your")
    assert 'under `if __name__ == "__main__":`' in last
    assert done.stderr.count("Traceback") == 1  # the workers end silently
    assert not list(out.iterdir())
