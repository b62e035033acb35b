"""Grasps of many objects in PyTorch: ``python jobs/examples/data_set.py DATA_SET``.

The data set is what ``softjaw export results/objects --format graspgen -o DATA_SET`` writes.
"""

import json
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np


class Grasps:
    """One item for each object of a split: poses (n, 4, 4) [m], success, force [N], payload [kg] and e_n [m]."""

    def __init__(self, folder: str, split: str = "train") -> None:
        names = (Path(folder) / "splits" / f"{split}.txt").read_text().split("\n")[:-1]
        self.files = [Path(folder) / "grasps" / Path(name).with_suffix(".json") for name in names]

    def __len__(self) -> int:
        return len(self.files)

    def __getitem__(self, number: int) -> dict[str, np.ndarray]:
        grasps = json.loads(self.files[number].read_text())["grasps"]
        names = ("transforms", "object_in_gripper", "force", "payload", "e_n")
        return {name: np.array(grasps[name], np.float32) for name in names}


if __name__ == "__main__":
    data = Grasps(sys.argv[1]) if len(sys.argv) == 2 else sys.exit(__doc__)
    batches: Iterable[Any] = [data[n] for n in range(len(data))]  # an object's grasps at a time
    with suppress(ImportError):
        from torch.utils.data import ConcatDataset, DataLoader

        each = ConcatDataset(
            [[{k: v[i] for k, v in item.items()} for i in range(len(item["force"]))] for item in batches]
        )
        batches = DataLoader(each, batch_size=64, shuffle=True)
    good = whole = 0
    for batch in batches:
        good, whole = good + int(batch["object_in_gripper"].sum()), whole + len(batch["force"])
    print(f"{len(data)} objects, {good} of {whole} grasps are successful")
