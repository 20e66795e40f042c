# Sourced by run: which kernel a guest can have on this computer, tried before anything is built on it.
# Wants of run $here, $job, $room, $memory, install and refuse; gives it boot and find_kernel.

compile() { # NAME: the C file of that name beside this one, as a library in the job's folder
    "${CC:-cc}" -O2 -shared -fPIC -o "$job/$1.so" "$here/$1.c" 2>"$job/compiler"
}

boot() { # MODE [COMMAND WORD...]: ends with the guest, by way of these words; its console is the output
    TMPDIR=$room LD_PRELOAD=$preload exec "${@:2}" \
        linux.uml mem="$memory" uml_dir="$job" umid=guest \
        root=/dev/root rootfstype=hostfs rootflags=/ ro quiet \
        init="$job/init" job="$job" guest_mode="$1" con=null con0=null,fd:1 </dev/null 2>&1
}

# Whether a guest comes as far as its first process; a second or two. Else $reason.
lives() {
    { (ulimit -c 0 && boot probe timeout --kill-after=5 60) >"$job/console" || true; } 2>/dev/null # nor "Aborted"
    ! grep -q '^guest: its first process runs' "$job/console" || return 0
    if too_wide; then
        reason="this processor's floating-point state$(grep -qw amx_tile /proc/cpuinfo && echo ' (AMX)' || true)"
        reason+=" is larger than User Mode Linux's buffer (put_fp_registers)"
        [[ $preload != *wide_fp_state* ]] || reason+=", also with wide_fp_state.c"
    elif grep -qE 'No working init found|Requested init .* failed|Attempted to kill init! exitcode=0x0000[0-9a-f]{2}00' "$job/console"; then
        refuse "User Mode Linux boots, but tests/guest/init does not run: $(complaint)" # no skip: that is our own fault
    else
        reason="User Mode Linux does not boot: $(complaint)"
    fi
    return 1
}
too_wide() { grep -q 'ptrace set fp regs failed' "$job/console"; }
complaint() { # the line of the console that tells most
    grep -m1 -iE 'panic|fatal|denied|not permitted|cannot' "$job/console" ||
        grep . "$job/console" | tail -1 | grep . || echo "it said nothing within 60 s"
}

widen() { # puts wide_fp_state.c under the guest; else tells in $reason why not
    if ! compile wide_fp_state && ! { install gcc libc6-dev && compile wide_fp_state; }; then
        reason+=", and tests/guest/wide_fp_state.c does not compile (Debian: gcc libc6-dev): $(head -1 "$job/compiler")"
        return 1
    fi
    preload=$job/wide_fp_state.so${preload:+:$preload}
}

find_kernel() { # sets $preload; fails with the $reason where no kernel is to be had
    preload= reason="GUEST_WIDE_FP is set"
    if [ -n "${GUEST_LIKE_AMX:-}" ]; then
        compile like_amx || refuse "like_amx.c does not compile: $(head -1 "$job/compiler")"
        preload=$job/like_amx.so
    fi
    if [ -z "${GUEST_WIDE_FP:-}" ]; then
        ! lives || return 0
        too_wide || return 1
        echo "tests/guest/run: $reason; trying it with wide_fp_state.c" >&2
    fi
    widen && lives
}
