// A pseudo terminal has no modem lines, and libserialport does not open a port without them. This
// ioctl(), which the dynamic linker uses for the library's calls too, answers for them, like a USB
// adapter.

#include <sys/ioctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdarg>

extern "C" int ioctl(int fd, unsigned long request, ...) noexcept {
  va_list arguments;
  va_start(arguments, request);
  void* const argument = va_arg(arguments, void*);
  va_end(arguments);
  const auto result = static_cast<int>(::syscall(SYS_ioctl, fd, request, argument));
  if (result == 0 || errno != ENOTTY) return result;
  switch (request) {
    case TIOCMGET:
      *static_cast<int*>(argument) = TIOCM_DTR | TIOCM_RTS;
      return 0;
    case TIOCMSET:
    case TIOCMBIS:
    case TIOCMBIC:
      return 0;
    default:
      return result;
  }
}
