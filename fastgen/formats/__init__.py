"""Label formats: the files that training tools read.

Each format is one module with an instance FORMAT of a subclass of `format.Format`, and `registry`
finds it there. A new format is one new module. `coco` and `yolo` hold what several formats share.

Formats turn pixels and labels into bytes. `dataset/` decides where the bytes are stored.
"""
