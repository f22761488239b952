"""`fastgen studio`: a local page that shows what each value of a configuration does.

`controls.py` derives the controls of the page from the JSON Schema. `changes.py` turns their values
into a configuration, a file and a command. `drawing.py` renders on one thread, and `layers.py`
makes the images of a rendered sample. `server.py` answers the page, whose own files are in `page/`.

The page is plain HTML, CSS and JavaScript behind Starlette and uvicorn. They start in a fifth of
the time of NiceGUI or Panel and install 7 packages instead of 49 and 31. The picture needs a script
of its own in any case: it blends layers, zooms to single pixels and drops outdated slider values.
"""
