/* Makes a computer without AMX treat NT_X86_XSTATE as one with it, for tests of wide_fp_state.c.
 *
 * The set has 11008 bytes (Intel SDM 1, 13.5: tile data from 2816 on), of which those that this
 * processor lacks are zero; any part of it is read, none shorter than the whole is written.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/uio.h>

#define NT_X86_XSTATE 0x202 /* elf.h */
#define WHOLE 11008

typedef long (*ptrace_t)(int, pid_t, void *, void *);

static long get_state(ptrace_t next_ptrace, pid_t pid, struct iovec *set)
{
    size_t wanted = set->iov_len < WHOLE ? set->iov_len : WHOLE;
    long result = next_ptrace(PTRACE_GETREGSET, pid, (void *)NT_X86_XSTATE, set);

    if (result == 0 && set->iov_len < wanted) {
        memset((char *)set->iov_base + set->iov_len, 0, wanted - set->iov_len);
        set->iov_len = wanted;
    }
    return result;
}

long ptrace(enum __ptrace_request request, ...)
{
    static ptrace_t next_ptrace;
    if (next_ptrace == NULL)
        next_ptrace = (ptrace_t)dlsym(RTLD_NEXT, "ptrace");

    va_list rest;
    va_start(rest, request);
    pid_t pid = va_arg(rest, pid_t);
    void *address = va_arg(rest, void *);
    void *data = va_arg(rest, void *);
    va_end(rest);

    if (address == (void *)NT_X86_XSTATE && request == PTRACE_GETREGSET)
        return get_state(next_ptrace, pid, data);
    if (address == (void *)NT_X86_XSTATE && request == PTRACE_SETREGSET && ((struct iovec *)data)->iov_len < WHOLE) {
        errno = EFAULT;
        return -1;
    }
    return next_ptrace(request, pid, address, data);
}
