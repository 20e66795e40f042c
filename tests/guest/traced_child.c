/* For the test of wide_fp_state.c: a traced child with a known YMM0, and what ptrace says of it.
 *
 *   traced_child BYTES      # sets XMM0 by a set NT_X86_XSTATE of so many bytes
 *
 * Prints a line for each request, with result and error, and YMM0 as the child has it in the end.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <signal.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/uio.h>
#include <sys/user.h>
#include <sys/wait.h>
#include <unistd.h>

#define NT_PRSTATUS 1
#define NT_PRFPREG 2
#define NT_X86_XSTATE 0x202
#define XMM0 160 /* of the legacy region: Intel SDM 1, table 10-2 */

static long peeked = 0x123456789abcdef;

static void child(void)
{
    unsigned char ymm[32];
    memset(ymm, 0x11, sizeof ymm);
    ptrace(PTRACE_TRACEME, 0, NULL, NULL);
    /* The system call that stops it is made between the two, so that nothing else uses YMM0. */
    __asm__ volatile("vmovdqu %0, %%ymm0\n\t"
                     "syscall\n\t"
                     "vmovdqu %%ymm0, %0"
                     : "+m"(ymm)
                     : "a"(62L /* kill */), "D"((long)getpid()), "S"((long)SIGSTOP)
                     : "rcx", "r11", "xmm0", "memory");
    printf("ymm0");
    for (size_t i = 0; i < sizeof ymm; i++)
        printf("%s%02x", i % 16 ? "" : " ", ymm[i]);
    printf(" peeked %lx\n", peeked);
}

static void tell(const char *what, long result)
{
    printf("%s: %lx %s\n", what, (unsigned long)result, errno ? strerror(errno) : "");
    errno = 0;
}

static void tell_set(const char *what, int request, pid_t pid, long type, void *start, size_t length)
{
    struct iovec set = {start, length};
    tell(what, ptrace(request, pid, (void *)type, &set));
    tell("  bytes", (long)set.iov_len);
}

static void other_requests(pid_t pid)
{
    struct user_regs_struct registers;
    struct user_fpregs_struct fp;
    siginfo_t signal_told;

    tell("peek data", ptrace(PTRACE_PEEKDATA, pid, &peeked, NULL));
    tell("poke data", ptrace(PTRACE_POKEDATA, pid, &peeked, (void *)0x42L));
    tell("peek nowhere", ptrace(PTRACE_PEEKDATA, pid, (void *)8, NULL));
    tell("peek user", ptrace(PTRACE_PEEKUSER, pid, (void *)offsetof(struct user, regs.orig_rax), NULL));
    tell("get registers", ptrace(PTRACE_GETREGS, pid, NULL, &registers));
    tell("  system call", (long)registers.orig_rax);
    tell("set registers", ptrace(PTRACE_SETREGS, pid, NULL, &registers));
    tell_set("get set", PTRACE_GETREGSET, pid, NT_PRSTATUS, &registers, sizeof registers);
    tell_set("set set", PTRACE_SETREGSET, pid, NT_PRSTATUS, &registers, sizeof registers);
    tell_set("get fp set", PTRACE_GETREGSET, pid, NT_PRFPREG, &fp, sizeof fp);
    tell_set("set fp set, too short", PTRACE_SETREGSET, pid, NT_PRFPREG, &fp, 12);
    tell("get signal", ptrace(PTRACE_GETSIGINFO, pid, NULL, &signal_told));
    tell("  signal", signal_told.si_signo);
    tell("set options", ptrace(PTRACE_SETOPTIONS, pid, NULL, (void *)PTRACE_O_EXITKILL));
    tell("unknown", ptrace(0x7777, pid, NULL, NULL));
}

int main(int argc, char **argv)
{
    static unsigned char state[1 << 16];
    size_t bytes = argc > 1 ? (size_t)atoi(argv[1]) : sizeof state;
    pid_t pid = fork();

    if (pid == 0) {
        child();
        return 0;
    }
    waitpid(pid, NULL, 0);
    other_requests(pid);
    tell_set("get state", PTRACE_GETREGSET, pid, NT_X86_XSTATE, state, sizeof state);
    memset(state + XMM0, 0x77, 16);
    if (bytes < sizeof state)
        memset(state + bytes, 0x55, sizeof state - bytes); /* which nobody was handed */
    tell_set("set state", PTRACE_SETREGSET, pid, NT_X86_XSTATE, state, bytes);
    tell_set("get part", PTRACE_GETREGSET, pid, NT_X86_XSTATE, state, XMM0);
    tell("go on", ptrace(PTRACE_CONT, pid, NULL, NULL));
    waitpid(pid, NULL, 0);
    tell_set("set state of nobody", PTRACE_SETREGSET, pid, NT_X86_XSTATE, state, bytes);
    return 0;
}
