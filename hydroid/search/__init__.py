"""Optimisers that know no robot."""

from hydroid.arrays import Array as Array
from hydroid.arrays import Ints as Ints
from hydroid.arrays import Mask as Mask
