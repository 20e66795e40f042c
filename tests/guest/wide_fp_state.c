/* Lets User Mode Linux run where the processor's floating-point state is larger than its buffer.
 *
 * Its kernel (6.1) keeps 2696 bytes of it, enough for AVX-512; with AMX the state has 11008. To read
 * a part of the register set NT_X86_XSTATE is allowed, to write a part is refused with EFAULT (Linux,
 * arch/x86/kernel/fpu/regset.c: "a whole standard-format XSAVE buffer is needed"), and the guest dies
 * in its first exec. Preloaded, this puts the process' own state behind the guest's part. What lies
 * there is nothing that a program in the guest can use: a process has to ask its kernel for AMX first.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/uio.h>

#define NT_X86_XSTATE 0x202 /* elf.h */

typedef long (*ptrace_t)(int, pid_t, void *, void *);

static ptrace_t next_ptrace;

/* On no stack: the guest's kernel calls from stacks of 16 KiB. Its one thread is alone with it. */
static unsigned char whole[1 << 16] __attribute__((aligned(64)));

__attribute__((constructor)) static void find_next(void)
{
    next_ptrace = (ptrace_t)dlsym(RTLD_NEXT, "ptrace");
}

static long set_whole_state(pid_t pid, const struct iovec *part)
{
    struct iovec own = {whole, sizeof whole};

    /* The size is asked for each time: it is the process', not the processor's. Where it is not
     * told, or nothing is missing, the answer to the caller's own request is the right one. */
    if (next_ptrace(PTRACE_GETREGSET, pid, (void *)NT_X86_XSTATE, &own) != 0 || own.iov_len <= part->iov_len)
        return next_ptrace(PTRACE_SETREGSET, pid, (void *)NT_X86_XSTATE, (void *)part);
    memcpy(whole, part->iov_base, part->iov_len);
    return next_ptrace(PTRACE_SETREGSET, pid, (void *)NT_X86_XSTATE, &own);
}

long ptrace(enum __ptrace_request request, ...)
{
    va_list rest;
    va_start(rest, request);
    pid_t pid = va_arg(rest, pid_t);
    void *address = va_arg(rest, void *);
    void *data = va_arg(rest, void *);
    va_end(rest);

    if (request == PTRACE_SETREGSET && address == (void *)NT_X86_XSTATE && data != NULL)
        return set_whole_state(pid, data);
    return next_ptrace(request, pid, address, data);
}
