/* Between a User Mode Linux and a processor with AMX: preloaded, it lets the one set the registers of the other.
 *
 * The kernel takes a process's extended registers (PTRACE_SETREGSET, NT_X86_XSTATE) only whole. Linux 6.1 as a guest
 * knows the first 2696 bytes of them; with AMX they are 11008, the guest's first process gets no registers, and it
 * panics. What the guest does not know is read back and written as it was.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <elf.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/uio.h>

/* Not on the stack: the guest's kernel has little of it. One thread calls this. */
static char whole[65536];

long ptrace(enum __ptrace_request request, ...)
{
	static long (*next)(enum __ptrace_request, ...);
	va_list arguments;

	va_start(arguments, request);
	pid_t pid = va_arg(arguments, pid_t);
	void *address = va_arg(arguments, void *);
	void *data = va_arg(arguments, void *);
	va_end(arguments);
	if (!next)
		*(void **)&next = dlsym(RTLD_NEXT, "ptrace");
	if (request != PTRACE_SETREGSET || (long)address != NT_X86_XSTATE)
		return next(request, pid, address, data);

	struct iovec *known = data, all = {whole, sizeof(whole)};
	if (next(PTRACE_GETREGSET, pid, address, &all) < 0)
		return -1;
	memcpy(whole, known->iov_base, known->iov_len < all.iov_len ? known->iov_len : all.iov_len);
	return next(request, pid, address, &all);
}
