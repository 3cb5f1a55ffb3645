"""Writes one log, as named columns, in every format that is read."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

Columns = Mapping[str, np.ndarray]


def write_mat(path: Path, columns: Columns) -> Path:
    from scipy.io import savemat

    savemat(path, dict(columns))
    return path


def write_mat73(path: Path, columns: Columns) -> Path:
    """A file as MATLAB's `save -v7.3` writes it: HDF5 behind a header of 512 bytes,
    arrays transposed."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in columns.items():
            matlab(file, name, values[:, None])
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512))
    return path


def matlab(group, name: str, value) -> None:
    if isinstance(value, dict):
        inner = group.create_group(name)
        inner.attrs["MATLAB_class"] = np.bytes_("struct")
        for field, part in value.items():
            matlab(inner, field, part)
    else:
        data = group.create_dataset(name, data=np.asarray(value).T)
        data.attrs["MATLAB_class"] = np.bytes_("double")


def write_parquet(path: Path, columns: Columns) -> Path:
    import pyarrow
    from pyarrow import parquet

    parquet.write_table(pyarrow.table(dict(columns)), path)
    return path


class BagWriter:
    """Writes JointState and Float64MultiArray messages into a bag: "ros1", "ros2" or
    "mcap"."""

    def __init__(self, path: Path, kind: str) -> None:
        from rosbags import rosbag1, rosbag2
        from rosbags.typesys import Stores, get_typestore

        self.one = kind == "ros1"
        self.store = get_typestore(
            Stores.ROS1_NOETIC if self.one else Stores.ROS2_HUMBLE
        )
        plugin = (
            rosbag2.StoragePlugin.MCAP
            if kind == "mcap"
            else rosbag2.StoragePlugin.SQLITE3
        )
        self.writer = (
            rosbag1.Writer(path)
            if self.one
            else rosbag2.Writer(path, version=8, storage_plugin=plugin)
        )
        self.topics: dict = {}

    def __enter__(self) -> "BagWriter":
        self.writer.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.writer.close()

    def write(self, topic: str, at: float, message) -> None:
        if topic not in self.topics:
            self.topics[topic] = self.writer.add_connection(
                topic, message.__msgtype__, typestore=self.store
            )
        pack = self.store.serialize_ros1 if self.one else self.store.serialize_cdr
        self.writer.write(
            self.topics[topic], round(at * 1e9), pack(message, message.__msgtype__)
        )

    def joints(self, stamp: float, names: list[str], position: np.ndarray):
        types = self.store.types
        time = types["builtin_interfaces/msg/Time"](*divmod(round(stamp * 1e9), 10**9))
        more = {"seq": 0} if self.one else {}
        header = types["std_msgs/msg/Header"](stamp=time, frame_id="", **more)
        nothing = np.zeros(0)
        kind = types["sensor_msgs/msg/JointState"]
        return kind(
            header=header,
            name=names,
            position=position,
            velocity=nothing,
            effort=nothing,
        )

    def array(self, values: np.ndarray):
        types = self.store.types
        layout = types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
        return types["std_msgs/msg/Float64MultiArray"](layout=layout, data=values)
