"""The routes under /api/v1, a file per subject; each makes one router.

Every route carries a guard of ``access``; the application refuses to be made with one that does not.
"""
