"""What every part of the package uses: arrays, checks, files, versions, progress, extras."""
