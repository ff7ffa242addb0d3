"""The trust models, one small file each."""
