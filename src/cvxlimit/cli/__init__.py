"""The command line: :mod:`main` parses and runs, :mod:`options` says what a command is.

:mod:`solving`, :mod:`looking`, :mod:`exporting` and :mod:`proving` have the commands of the core,
:mod:`report` what they show and refuse, :mod:`interrupting` Ctrl-C.
"""
