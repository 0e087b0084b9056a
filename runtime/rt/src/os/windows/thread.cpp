#include "rtpm/rt/thread.hpp"

#include <windows.h>

#include <process.h>

#include <array>
#include <cerrno>
#include <utility>

#include "rtpm/base/assert.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "thread_level.hpp"

namespace rtpm::rt {
namespace {

constexpr unsigned kStackSize = 512 * 1024;
// The part of the stack that is made resident before a thread starts: more than RTPM's code needs.
constexpr std::size_t kStackPrefaultSize = std::size_t{128} * 1024;

void prefault_stack() noexcept {
  std::array<volatile std::byte, kStackPrefaultSize> stack;
  constexpr std::size_t kPageSize = 4096;
  // Downwards: the system extends a stack page by page.
  for (std::size_t i = stack.size(); i > 0; i -= kPageSize)
    stack[i - 1] = std::byte{0};
}
// Called by this, so that it is not merged into its caller, whose frame would grow.
void (*volatile stack_prefaulter)() noexcept = &prefault_stack;

HANDLE native(std::uintptr_t handle) noexcept {
  return reinterpret_cast<HANDLE>(handle);
}

// Passed from start() to the new thread, which answers through `outcome` and then runs the body.
struct Launch {
  ThreadConfig config;
  std::function<void()> body;
  GROUP_AFFINITY cpus{};  ///< The starter's.
  expected<void, SetupError> outcome{};
  Semaphore is_configured{};
};

unsigned __stdcall run_thread(void* argument) {
  auto* launch = static_cast<Launch*>(argument);
  SetThreadGroupAffinity(GetCurrentThread(), &launch->cpus, nullptr);
  launch->outcome = configure_this_thread(launch->config);
  if (!launch->outcome) {
    os::leave_multimedia_class();
    launch->is_configured.post();
    return 0;
  }
  {
    const std::function<void()> body = std::move(launch->body);
    stack_prefaulter();
    launch->is_configured.post();
    body();
  }
  os::leave_multimedia_class();
  return 0;
}

}  // namespace

expected<Thread, SetupError> Thread::start(const ThreadConfig& config, std::function<void()> body) {
  Launch launch{config, std::move(body)};
  GetThreadGroupAffinity(GetCurrentThread(), &launch.cpus);
  // A new thread has the process's priority, not its starter's.
  const std::uintptr_t handle = _beginthreadex(nullptr, kStackSize, &run_thread, &launch,
                                               STACK_SIZE_PARAM_IS_A_RESERVATION, nullptr);
  if (handle == 0) {
    return setup_error("thread '" + config.name + "' can't be started", system_error(errno),
                       "end other programs, or enlarge the paging file");
  }
  Thread thread;
  thread.handle_ = handle;
  static_cast<void>(launch.is_configured.wait_until(kNever));
  if (!launch.outcome) {
    thread.join();
    return unexpected{launch.outcome.error()};
  }
  return thread;
}

Thread::Thread(Thread&& other) noexcept : handle_(std::exchange(other.handle_, std::nullopt)) {}

Thread& Thread::operator=(Thread&& other) noexcept {
  join();
  handle_ = std::exchange(other.handle_, std::nullopt);
  return *this;
}

Thread::~Thread() {
  join();
}

void Thread::join() noexcept {
  if (!handle_) return;
  RTPM_ASSERT(GetThreadId(native(*handle_)) != GetCurrentThreadId(),
              "a thread can't wait for its own end");
  WaitForSingleObject(native(*handle_), INFINITE);
  CloseHandle(native(*handle_));
  handle_.reset();
}

}  // namespace rtpm::rt
