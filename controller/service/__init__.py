"""The process of ``directrix serve``: parent of tick and plan, and the far side of the control socket.

Threads, and what each may wait for. The *door* reads requests from the socket and answers them: a hold comes
through it, so it takes neither of the service's two locks and waits for no disk; what must change a job goes
to the *sequencer* (one thread, one thing at a time: start, home, reset ...), what waits for a disk to the
*errands*. The *main* thread looks at the newest snapshot (``Service.look``) and draws conclusions; the *plan*
thread brings what the planner tells (``Service._hear``); *records* and *sync* write to the disk. Of the two
locks, ``Service.fitting`` guards what is fitted (offsets, tools) and what begins with it, ``Service.lock``
the job that runs and its record. ``fitting`` is taken before ``lock``, never while ``lock`` is held. Smaller
owners (usage, alarms, probed points, the changer) have locks of their own.
``tests/controller/service/test_locks.py`` holds these rules.
"""
