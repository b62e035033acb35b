"""``silx_picture.py FILE PICTURE``: what silx shows of a file when it is opened, as a picture; and its own checks."""

import json
import os
import sys
import time

os.environ["QT_QPA_PLATFORM"] = "offscreen"

import h5py
import silx.io
from silx.gui import qt
from silx.gui.data.DataViewerFrame import DataViewerFrame
from silx.io import nxdata

path, picture = sys.argv[1:]
with h5py.File(path) as file:
    plots = {}
    file.visititems(lambda n, g: plots.update({n: g}) if g.attrs.get("NX_class") == "NXdata" else None)
    issues = {name: nxdata.NXdata(group).issues for name, group in plots.items()}
    default = nxdata.get_default(file)
    told = {"plots": len(plots), "issues": {n: i for n, i in issues.items() if i}, "default": default.group.name}
application = qt.QApplication([])
window = DataViewerFrame()
window.resize(1000, 700)
window.setData(silx.io.open(path)["/"])
window.show()
for _ in range(40):
    application.processEvents()
    time.sleep(0.02)
window.grab().save(picture)
print(json.dumps({**told, "view": window.displayedView().label()}))
sys.stdout.flush()
os._exit(0)  # Qt without a screen may crash when it is taken down
