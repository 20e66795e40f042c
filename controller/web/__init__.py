"""The page an operator works with: static files, the same for everybody, and who may have them.

Nothing of a machine is in them. ``static/main.js`` asks the panel's routes and hears its events as any
script would, so the page has no way to the machine that a script has not, and a figure has one source.
What was written by others lies in ``static/vendor``; see ``vendor``.
"""
