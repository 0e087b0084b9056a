#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "rtpm/asio/net.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rpc/completions.hpp"
#include "rtpm/rt/thread.hpp"

/// Internal: the pieces of asynchronous operations.
namespace rtpm::asio {
inline namespace RTPM_ASIO_FLAVOUR {
namespace detail {

/// An operation that Asio has queued.
class Posted {
 public:
  Posted() = default;
  Posted(const Posted&) = delete;
  Posted& operator=(const Posted&) = delete;
  virtual ~Posted() = default;
  /// Runs the handler.
  virtual void run(std::unique_ptr<Posted> self) = 0;
};

/// The executor of a handler, with work there and at the I/O object's executor.
template <class Executor>
class Work {
 public:
  Work(const Executor& executor, const net::any_io_executor& io)
      : executor_(executor), work_(executor), io_work_(io) {}
  /// @param posted  may own this object
  void post(std::unique_ptr<Posted> posted) const {
    const Executor executor = executor_;
    net::post(executor, Run{std::move(posted)});
  }

 private:
  struct Run {
    std::unique_ptr<Posted> posted;
    void operator()() {
      Posted& operation = *posted;
      operation.run(std::move(posted));
    }
  };
  Executor executor_;
  net::executor_work_guard<Executor> work_;
  net::executor_work_guard<net::any_io_executor> io_work_;
};

/// A started operation, of any handler: little is compiled for each handler. Destruction without
/// post() destroys the handler without running it.
template <class... Values>
class Operation : public Posted {
 public:
  /// Lets the handler's executor run it, later.
  static void post(std::unique_ptr<Operation> self, Values... values) {
    self->values_.emplace(std::move(values)...);
    Operation& operation = *self;
    operation.queue(std::move(self));
  }
  /// The same with the error of a call that ended on this thread.
  static void fail(std::unique_ptr<Operation> self, rpc::CallError error) {
    if (error == rpc::CallError::kBadRequest || error == rpc::CallError::kServantFailed) {
      self->refusal_ = rpc::refusal_text();
    }
    end(std::move(self), code_of(error));
  }
  /// The same with an error, and no value.
  static void end(std::unique_ptr<Operation> self, const ErrorCode& error) {
    fill(std::move(self), error, static_cast<std::tuple<Values...>*>(nullptr));
  }

 protected:
  virtual void queue(std::unique_ptr<Posted> self) = 0;
  /// Makes the refusal's text that of the thread that runs the handler.
  void restore_refusal() const {
    if (refusal_) rpc::set_refusal_text(*refusal_);
  }
  std::optional<std::tuple<Values...>> values_{};

 private:
  static void fill(std::unique_ptr<Operation> self, const ErrorCode& error,
                   std::tuple<ErrorCode>*) {
    post(std::move(self), error);
  }
  template <class Value>
  static void fill(std::unique_ptr<Operation> self, const ErrorCode& error,
                   std::tuple<ErrorCode, Value>*) {
    if constexpr (std::is_default_constructible_v<Value>) {
      post(std::move(self), error, Value{});
    } else {
      post(std::move(self), error, Value{rpc::ReplyLease{}});  // A table.
    }
  }

  std::optional<std::string> refusal_{};  ///< See rpc::refusal_text().
};

/// An operation of one kind of handler.
template <class Handler, class... Values>
class OperationOf final : public Operation<Values...> {
 public:
  OperationOf(Handler handler, const net::any_io_executor& io)
      : work_(net::get_associated_executor(handler, io), io), handler_(std::move(handler)) {}

 private:
  void queue(std::unique_ptr<Posted> self) override { work_.post(std::move(self)); }
  void run(std::unique_ptr<Posted> self) override {
    this->restore_refusal();
    Handler handler = std::move(handler_);
    std::tuple<Values...> values = *std::move(this->values_);
    // As Asio does, before the handler, which may start the next operation.
    self.reset();
    std::apply(std::move(handler), std::move(values));
  }

  Work<net::associated_executor_t<Handler, net::any_io_executor>> work_;
  Handler handler_;
};

template <class... Values, class Handler>
[[nodiscard]] std::unique_ptr<Operation<Values...>> make_operation(Handler handler,
                                                                   const net::any_io_executor& io) {
  return std::make_unique<OperationOf<Handler, Values...>>(std::move(handler), io);
}

/// Connects `cancel` with the cancellation slot of a handler, if Asio has slots. Signals of at
/// least the strength `kind` call it.
#ifdef RTPM_ASIO_HAS_SLOTS
using CancellationType = net::cancellation_type_t;
/// The side effects of a cancelled call are unknown, but its object stays usable.
inline constexpr CancellationType kEndsCall =
    net::cancellation_type::terminal | net::cancellation_type::partial;
/// A cancelled wait has no side effects.
inline constexpr CancellationType kEndsWait = kEndsCall | net::cancellation_type::total;
template <class Handler>
[[nodiscard]] auto slot_of(const Handler& handler) {
  return net::get_associated_cancellation_slot(handler);
}
template <class Slot, class Cancel>
void connect(Slot slot, CancellationType kind, Cancel cancel) {
  if (!slot.is_connected()) return;
  slot.assign([kind, cancel = std::move(cancel)](CancellationType type) {
    if ((type & kind) != net::cancellation_type::none) cancel();
  });
}
#else
struct NoSlot {};
inline constexpr NoSlot kEndsCall{};
inline constexpr NoSlot kEndsWait{};
template <class Handler>
[[nodiscard]] NoSlot slot_of(const Handler&) {
  return {};
}
template <class Cancel>
void connect(NoSlot, NoSlot, Cancel) {}
#endif

/// A part with open operations, which it drops when their context is destroyed.
class Part {
 public:
  Part() = default;
  Part(const Part&) = delete;
  Part& operator=(const Part&) = delete;
  virtual ~Part() = default;
  /// Destroys the handlers without running them, and releases everything of the context.
  virtual void shut_down() noexcept = 0;
};

/// Threads for set-up that blocks. As many as jobs at a time, up to a limit; the others wait.
class Helpers {
 public:
  Helpers() : work_(jobs_.get_executor()) {}
  ~Helpers() {
    jobs_.stop();
    for (rt::Thread& thread : threads_)
      thread.join();
  }
  Helpers(const Helpers&) = delete;
  Helpers& operator=(const Helpers&) = delete;

  template <class Job>
  void run(Job job) {
    constexpr std::size_t kThreadCountMax = 4;
    {
      const std::lock_guard lock(mutex_);
      if (job_count_ >= threads_.size() && threads_.size() < kThreadCountMax) {
        auto thread = rt::Thread::start({.name = "rtpm-asio"}, [this] { jobs_.run(); });
        if (thread) threads_.push_back(std::move(*thread));
      }
      if (!threads_.empty()) {
        ++job_count_;
        net::post(jobs_, [this, job = std::move(job)]() mutable {
          job();
          const std::lock_guard ended(mutex_);
          --job_count_;
        });
        return;
      }
    }
    job();  // No thread is left.
  }

 private:
  net::io_context jobs_{};
  net::executor_work_guard<net::io_context::executor_type> work_;
  std::mutex mutex_{};
  std::size_t job_count_ = 0;
  std::vector<rt::Thread> threads_{};
};

/// The parts of one context, and its helpers.
/// @threads  any
class Service final : public net::execution_context::service {
 public:
  using key_type = Service;
  static inline net::execution_context::id id{};

  explicit Service(net::execution_context& context) : net::execution_context::service(context) {}
  [[nodiscard]] static Service& of(const net::any_io_executor& io) {
    return net::use_service<Service>(net::query(io, net::execution::context));
  }

  void add(const std::shared_ptr<Part>& part) {
    const std::lock_guard lock(mutex_);
    std::erase_if(parts_, [](const auto& each) { return each.expired(); });
    parts_.push_back(part);
  }
  template <class Job>
  void help(Job job) {
    Helpers* helpers = nullptr;
    {
      const std::lock_guard lock(mutex_);
      if (!helpers_) helpers_.emplace();
      helpers = &*helpers_;
    }
    helpers->run(std::move(job));
  }

 private:
  void shutdown() override {
    std::vector<std::weak_ptr<Part>> parts;
    {
      const std::lock_guard lock(mutex_);
      parts.swap(parts_);
    }
    for (const std::weak_ptr<Part>& each : parts) {
      if (const auto part = each.lock()) part->shut_down();
    }
    helpers_.reset();
  }

  std::mutex mutex_{};
  std::vector<std::weak_ptr<Part>> parts_{};
  std::optional<Helpers> helpers_{};
};

/// Makes a part known to its context.
template <class T, class... Arguments>
[[nodiscard]] std::shared_ptr<T> make_part(const net::any_io_executor& io,
                                           Arguments&&... arguments) {
  auto part = std::make_shared<T>(io, std::forward<Arguments>(arguments)...);
  Service::of(io).add(part);
  return part;
}

}  // namespace detail
}  // namespace RTPM_ASIO_FLAVOUR
}  // namespace rtpm::asio
