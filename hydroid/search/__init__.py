"""Optimisers that know no robot."""

from hydroid.arrays import Array as Array, Ints as Ints, Mask as Mask
