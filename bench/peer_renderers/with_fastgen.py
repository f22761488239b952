"""fastgen measured in the same way as its peers: python with_fastgen.py JOB OUT QUALITY."""

import os
import sys
from pathlib import Path

# one thread per process, like in `fastgen generate`; llvmpipe reads it at the first context
os.environ.setdefault("LP_NUM_THREADS", "0")

from measure import Recorder, read_job

import fastgen
from fastgen import Config, Generator
from fastgen.scene import Scene


def main(folder: Path, out: Path, quality: str) -> None:
    """Render every view; one draw gives the image and all labels."""
    job = read_job(folder)
    config = Config.preset()
    with Generator(config, seed=job.seed, size=job.size, quality=quality) as generator:
        recorder = Recorder(out, f"{fastgen.__version__}, {generator.renderer_name}")
        for scene in job.scenes:
            with recorder.lap("set-up"):
                text = Path(scene.glb).with_suffix(".json").read_text(encoding="utf-8")
                plain = Scene.from_json(text)
                generator.render(scene=plain, camera=scene.shots[0].camera)
            for shot in scene.shots:
                generator.render(scene=plain, camera=shot.camera)
                for _ in range(job.repeats):
                    with recorder.lap("colour"):
                        sample = generator.render(scene=plain, camera=shot.camera)
                    with recorder.lap("labels"):
                        pass  # the labels came with the image
                recorder.keep(scene, shot, sample.image, sample.ids)
        recorder.save()


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3])
