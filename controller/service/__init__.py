"""The process of ``directrix serve``: parent of tick and plan, and the far side of the control socket.

Owners. ``Service`` puts them together: ``Engine`` has the processes and their sockets, ``Processes`` whether
they live and the drives have their settings, ``SetUp`` offsets, tools and the tool in the spindle, ``JobRun``
the program from load to end with its record (``RunRecorder``); ``Watch`` draws conclusions, and ``Journal``,
``Alarms``, ``Usage``, ``Probed`` and ``Durations`` have files of their own. Each changes what is its own, and
whoever else wants it changed asks (``tests/controller/service/test_owners.py``).

Threads, and what each may wait for. The *door* reads requests from the socket and answers them: a hold comes
through it, so it takes neither of the service's two locks and waits for no disk; what must change a job goes
to the *sequencer* (one thread, one thing at a time: start, home, reset ...), what waits for a disk to the
*errands*. The *main* thread looks at the newest snapshot (``Watch.look``) and draws conclusions; the *plan*
thread brings what the planner tells (``JobRun.hear``); *records* and *sync* write to the disk. Of the two
locks, ``SetUp.lock`` guards what is fitted (offsets, tools) and what begins with it, ``JobRun.lock`` the job
that runs and its record. ``SetUp.lock`` is taken before ``JobRun.lock``, never while that is held. Smaller
owners (usage, alarms, probed points, the changer) have locks of their own.
``tests/controller/service/test_locks.py`` holds these rules.
"""
