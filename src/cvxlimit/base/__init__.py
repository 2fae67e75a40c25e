"""What every part of the package uses: arrays, checks, files, versions, progress,
searches over many solves, extras."""
