#include <pthread.h>
#include <sched.h>

#include <array>
#include <cstring>
#include <semaphore>
#include <utility>

#include "rtpm/base/assert.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::rt {
namespace {

#if defined(__SANITIZE_THREAD__)
// ThreadSanitizer keeps half a megabyte of per-thread state at the end of the stack.
constexpr std::size_t kStackSize = std::size_t{4096} * 1024;
#else
constexpr std::size_t kStackSize = std::size_t{512} * 1024;
#endif
// The part of the stack that is made resident before a thread starts: more than RTPM's code needs.
constexpr std::size_t kStackPrefaultSize = std::size_t{128} * 1024;

// Memory is locked when touched, so the stack is touched before it matters.
[[gnu::noinline]] void prefault_stack() noexcept {
  std::array<volatile std::byte, kStackPrefaultSize> stack;
  constexpr std::size_t kPageSize = 4096;
  for (std::size_t i = 0; i < stack.size(); i += kPageSize)
    stack[i] = std::byte{0};
}

static_assert(sizeof(pthread_t) <= sizeof(std::uintptr_t), "a Thread holds the system's handle");

std::uintptr_t handle_of(pthread_t thread) noexcept {
  std::uintptr_t handle = 0;
  std::memcpy(&handle, &thread, sizeof thread);
  return handle;
}

pthread_t native(std::uintptr_t handle) noexcept {
  pthread_t thread{};
  std::memcpy(&thread, &handle, sizeof thread);
  return thread;
}

// Passed from start() to the new thread, which answers through `outcome` and then runs the body.
struct Launch {
  ThreadConfig config;
  std::function<void()> body;
  expected<void, SetupError> outcome{};
  std::binary_semaphore is_configured{0};
};

void* run_thread(void* argument) {
  auto* launch = static_cast<Launch*>(argument);
  launch->outcome = configure_this_thread(launch->config);
  if (!launch->outcome) {
    launch->is_configured.release();
    return nullptr;
  }
  const std::function<void()> body = std::move(launch->body);
  prefault_stack();
  launch->is_configured.release();
  body();
  return nullptr;
}

}  // namespace

expected<Thread, SetupError> Thread::start(const ThreadConfig& config, std::function<void()> body) {
  Launch launch{config, std::move(body)};
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  // With locked memory the whole stack is resident, so the system's 8 MiB would be wasteful.
  pthread_attr_setstacksize(&attributes, kStackSize);
  // Otherwise the thread would inherit its starter's level, and keep it if it has no priority.
  const sched_param time_shared{};
  pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
  pthread_attr_setschedpolicy(&attributes, SCHED_OTHER);
  pthread_attr_setschedparam(&attributes, &time_shared);
  pthread_t handle{};
  const int error = pthread_create(&handle, &attributes, run_thread, &launch);
  pthread_attr_destroy(&attributes);
  if (error != 0) {
    return setup_error("thread '" + config.name + "'" + " can't be started", system_error(error),
                       "raise the limit of processes (ulimit -u), of memory (ulimit -v) or of "
                       "locked memory (ulimit -l)");
  }
  launch.is_configured.acquire();
  Thread thread;
  thread.handle_ = handle_of(handle);
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
  RTPM_ASSERT(pthread_equal(native(*handle_), pthread_self()) == 0,
              "a thread can't wait for its own end");
  pthread_join(native(*handle_), nullptr);
  handle_.reset();
}

}  // namespace rtpm::rt
