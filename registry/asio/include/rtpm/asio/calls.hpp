#pragma once

#include <concepts>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "rtpm/asio/net.hpp"
#include "rtpm/asio/operation.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rpc/completions.hpp"

namespace rtpm::asio {
inline namespace RTPM_ASIO_FLAVOUR {

namespace detail {

/// The signature of an operation with a value, and without.
template <class Value>
struct OperationFor {
  using Type = Operation<ErrorCode, Value>;
  using Signature = void(ErrorCode, Value);
};
template <>
struct OperationFor<void> {
  using Type = Operation<ErrorCode>;
  using Signature = void(ErrorCode);
};

/// The calls and streams of a Calls. The mutex makes one of its threads at a time the one that uses
/// `completions_`; no handler runs while it is locked.
class CallsState final : public Part, public std::enable_shared_from_this<CallsState> {
 public:
  explicit CallsState(net::any_io_executor io) : io_(std::move(io)) {}
  ~CallsState() override { release_descriptor(); }

  [[nodiscard]] const net::any_io_executor& executor() const noexcept { return io_; }

  template <class Value, class Handler>
  [[nodiscard]] auto make(Handler handler) const {
    using Type = typename OperationFor<Value>::Type;
    return [&]<class... Values>(Operation<Values...>*) {
      return make_operation<Values...>(std::move(handler), io_);
    }(static_cast<Type*>(nullptr));
  }
  /// Starts an operation, unless `try_now(operation)` has ended it: `add(completions, callback)`
  /// adds it, and `finish(operation, result)` ends it with the callback's result.
  template <class Type, class Slot, class Kind, class Try, class Add, class Finish>
  void start(std::unique_ptr<Type> operation, Slot slot, Kind kind, Try try_now, Add add,
             Finish finish) {
    const std::lock_guard lock(mutex_);
    if (is_shut_down_ || try_now(operation)) return;
    if (!open_descriptor()) {
      return Type::fail(std::move(operation), rpc::CallError::kNoResources);
    }
    const rpc::CallNumber number =
        add(completions_, [this, finish, operation = std::move(operation)](auto&& result) mutable {
          if (is_shut_down_) {
            dropped_.push_back(std::move(operation));
          } else {
            finish(std::move(operation), std::forward<decltype(result)>(result));
          }
        });
    connect(slot, kind, [state = weak_from_this(), number] {
      if (const auto self = state.lock()) self->cancel(number);
    });
    settle();
  }
  /// @param number  may change until the mutex is locked
  void cancel(const rpc::CallNumber& number) {
    const std::lock_guard lock(mutex_);
    if (is_shut_down_) return;
    completions_.cancel(number);
    static_cast<void>(completions_.poll());
    settle();
  }
  void cancel() {
    const std::lock_guard lock(mutex_);
    if (is_shut_down_) return;
    completions_.cancel_all();
    settle();
  }
  /// Lets a helper thread run `set_up`, and posts its result.
  template <class Result, class SetUp>
  void help(std::unique_ptr<Operation<Result>> operation, SetUp set_up) {
    Service::of(io_).help([self = shared_from_this(), set_up = std::move(set_up),
                           operation = std::move(operation)]() mutable {
      Result result = set_up();
      const std::lock_guard lock(self->mutex_);
      if (!self->is_shut_down_) {
        Operation<Result>::post(std::move(operation), std::move(result));
      }
    });
  }
  void shut_down() noexcept override {
    std::vector<std::unique_ptr<Posted>> dropped;
    const std::lock_guard lock(mutex_);
    is_shut_down_ = true;
    completions_.cancel_all();
    release_descriptor();
    dropped.swap(dropped_);
  }

 private:
  [[nodiscard]] bool open_descriptor() {
    if (descriptor_) return true;
    const auto number = completions_.descriptor();
    if (!number) return false;
    descriptor_.emplace(io_);
    ErrorCode error;
    assign(*descriptor_, *number, error);
    if (error) descriptor_.reset();
    return !error;
  }
  void release_descriptor() noexcept {
    if (descriptor_) give_back(*descriptor_);
    descriptor_.reset();
  }
  /// Waits while there is something to wait for, so that the loop ends when nothing is left.
  void settle() {
    const bool is_wanted = completions_.open_count() > 0;
    if (is_wanted && !is_waiting_) {
      is_waiting_ = true;
      descriptor_->async_wait(Watched::wait_read,
                              [self = shared_from_this()](const ErrorCode&) { self->poll(); });
    } else if (!is_wanted && is_waiting_) {
      ErrorCode ignored;
      static_cast<void>(descriptor_->cancel(ignored));
    }
  }
  void poll() {
    const std::lock_guard lock(mutex_);
    is_waiting_ = false;
    if (is_shut_down_) return;
    static_cast<void>(completions_.poll());
    settle();
  }

  net::any_io_executor io_;
  std::mutex mutex_{};
  rpc::Completions completions_{};
  /// Waits for the descriptor of `completions_`, which closes it.
  std::optional<Watched> descriptor_{};
  bool is_waiting_ = false;
  bool is_shut_down_ = false;
  std::vector<std::unique_ptr<Posted>> dropped_{};
};

}  // namespace detail

/// Calls in an Asio loop. One object serves all calls and streams of a loop by one descriptor:
///
///     rtpm::asio::Calls calls(loop);
///     …
///     auto position = co_await calls.async_call(arm.begin_get_position(), net::use_awaitable);
///
/// Deadlines are those of the calls, and servers are notified of cancellations. Handlers run by
/// their associated executor (bind_executor), else by that of this object; never inside the
/// function that starts or cancels. A cancellation slot (Asio 1.19, Boost 1.77) ends a single
/// operation at once with operation_aborted.
/// @ownership refers to the calls' bindings, which must outlive the calls. Destruction cancels open
///            calls: their handlers get operation_aborted. If the io_context is destroyed, open
///            handlers are destroyed without being run, and later operations do nothing
/// @threads  any, concurrently: the io_context may run on several threads
/// @realtime set-up only: starting allocates. A loop that counts microseconds should hold the
///           PendingReply itself and wait for it
class Calls {
 public:
  using executor_type = net::any_io_executor;

  explicit Calls(const executor_type& executor)
      : state_(detail::make_part<detail::CallsState>(executor)) {}
  template <class Context>
  requires std::convertible_to<Context&, net::execution_context&>
  explicit Calls(Context& context) : Calls(executor_type(context.get_executor())) {}
  Calls(Calls&&) noexcept = default;
  Calls& operator=(Calls&& other) noexcept {
    std::swap(state_, other.state_);
    return *this;
  }
  ~Calls() {
    if (state_) state_->cancel();
  }

  [[nodiscard]] executor_type get_executor() const noexcept { return state_->executor(); }

  /// Waits for the result of a generated begin_x(), which has sent the call. begin_x() itself waits
  /// for the server where no channel is free: at the first call of a band, when more calls are open
  /// than ever before, and after the connection was lost; at most until the call's deadline. A loop
  /// that must not wait for that runs it by async_set_up().
  /// @return   void(error_code, T); of methods without a result void(error_code)
  /// @errors   code_of() those of begin_x() and take() · operation_aborted. In the handler, and
  ///           behind co_await, rpc::describe() has the server's reason for kBadRequest and
  ///           kServantFailed
  template <class Pending, class Token>
  auto async_call(expected<Pending, rpc::CallError> begun, Token&& token) {
    using Value = typename Pending::Result::value_type;
    return net::async_initiate<Token, typename detail::OperationFor<Value>::Signature>(
        [state = state_](auto handler, expected<Pending, rpc::CallError> call) {
          const auto slot = detail::slot_of(handler);
          start(*state, std::move(call), state->template make<Value>(std::move(handler)), slot);
        },
        token, std::move(begun));
  }

  /// Runs a function that blocks on a helper thread, so that the loop goes on: binding, opening a
  /// device, subscribing, the first call of a band.
  ///
  ///     auto arm = co_await calls.async_set_up(
  ///         [&] { return lab::ArmClient::bind(node, "lab/arm0"); }, net::use_awaitable);
  ///
  /// At most four run at a time; the others wait. It can't be cancelled and ends by its own
  /// deadline, which the destruction of the io_context waits for.
  /// @param set_up  returns a value, and must not throw. GCC 12 destroys a lambda twice that stands
  ///                in the co_await expression: it may capture references there, while one that
  ///                captures objects must be a variable, given by std::move
  /// @return   void(R) with the function's result; set-up fails with RTPM's SetupError, a text
  template <class SetUp, class Token>
  auto async_set_up(SetUp set_up, Token&& token) {
    using Result = std::invoke_result_t<SetUp&>;
    return net::async_initiate<Token, void(Result)>(
        [state = state_](auto handler, SetUp function) {
          auto operation = detail::make_operation<Result>(std::move(handler), state->executor());
          state->help(std::move(operation), std::move(function));
        },
        token, std::move(set_up));
  }

  /// Cancels all open calls, and waits for items.
  void cancel() { state_->cancel(); }

 private:
  template <class>
  friend class Stream;

  template <class Pending, class Operation, class Slot>
  static void start(detail::CallsState& state, expected<Pending, rpc::CallError> call,
                    std::unique_ptr<Operation> operation, const Slot& slot) {
    state.start(
        std::move(operation), slot, detail::kEndsCall, [](const auto&) { return false; },
        [&](rpc::Completions& completions, auto callback) {
          return completions.then(std::move(call), std::move(callback));
        },
        [](std::unique_ptr<Operation> ended, typename Pending::Result result) {
          if (!result) {
            Operation::fail(std::move(ended), result.error());
          } else if constexpr (std::is_void_v<typename Pending::Result::value_type>) {
            Operation::post(std::move(ended), ErrorCode{});
          } else {
            Operation::post(std::move(ended), ErrorCode{}, std::move(*result));
          }
        });
  }

  std::shared_ptr<detail::CallsState> state_;
};

/// The items of a stream in an Asio loop; `S` is that of the generated stub:
///
///     rtpm::asio::Stream samples(calls, feed.watch());
///     while (true) {
///       auto [error, sample] = co_await samples.async_next(as_tuple(net::use_awaitable));
///       if (error) break;
///
/// While nobody waits for an item, the server waits, too, at most StreamOptions::pause_max.
/// @ownership refers to the stream's binding, which must outlive it. Destruction cancels the stream
/// @threads  one at a time; the io_context may run on several threads
template <class S>
class Stream {
 public:
  using executor_type = net::any_io_executor;
  /// A T, or for tables a `const T*`, valid until the next async_next().
  using Item = std::conditional_t<
      std::is_pointer_v<typename decltype(std::declval<S&>().next(MonotonicTime{}))::value_type>,
      typename decltype(std::declval<S&>().next(MonotonicTime{}))::value_type,
      std::remove_cvref_t<decltype(**std::declval<S&>().next(MonotonicTime{}))>>;

  /// Takes the result of the stub's method; its error is that of the first async_next().
  Stream(Calls& calls, expected<S, rpc::CallError> begun)
      : calls_(calls.state_), begun_(std::make_unique<Begun>(std::move(begun))) {}
  Stream(Stream&&) noexcept = default;
  Stream& operator=(Stream&& other) noexcept {
    std::swap(calls_, other.calls_);
    std::swap(begun_, other.begun_);
    return *this;
  }
  ~Stream() {
    if (begun_) calls_->cancel(begun_->wait);
  }

  [[nodiscard]] executor_type get_executor() const noexcept { return calls_->executor(); }

  /// Waits for the next item; one wait at a time. Cancelling it loses no item.
  /// @return   void(error_code, Item)
  /// @errors   eof: the server finished the stream · operation_aborted · code_of() those of the
  ///           stream
  template <class Token>
  auto async_next(Token&& token) {
    return net::async_initiate<Token, void(ErrorCode, Item)>(
        [calls = calls_, begun = begun_.get()](auto handler) {
          const auto slot = detail::slot_of(handler);
          start(*calls, *begun, calls->template make<Item>(std::move(handler)), slot);
        },
        token);
  }

 private:
  struct Begun {
    explicit Begun(expected<S, rpc::CallError> begun) : stream(std::move(begun)) {}
    expected<S, rpc::CallError> stream;
    rpc::CallNumber wait = 0;  ///< The open async_next(), or 0.
  };
  using Operation = detail::Operation<ErrorCode, Item>;

  template <class Slot>
  static void start(detail::CallsState& calls, Begun& begun, std::unique_ptr<Operation> next,
                    const Slot& slot) {
    calls.start(
        std::move(next), slot, detail::kEndsWait,
        [&begun](std::unique_ptr<Operation>& operation) {
          if (!begun.stream) {
            Operation::fail(std::move(operation), begun.stream.error());
            return true;
          }
          RTPM_ASSERT(begun.wait == 0, "one async_next() at a time");
          auto result = begun.stream->next(MonotonicTime{});
          if (!result && result.error() == rpc::CallError::kTimeout && begun.stream->is_open()) {
            return false;
          }
          finish(std::move(operation), std::move(result));
          return true;
        },
        [&begun](rpc::Completions& completions, auto callback) {
          return begun.wait = completions.then_next(*begun.stream, std::move(callback));
        },
        [&begun](std::unique_ptr<Operation> operation, auto result) {
          begun.wait = 0;
          finish(std::move(operation), std::move(result));
        });
  }
  template <class Result>
  static void finish(std::unique_ptr<Operation> operation, Result result) {
    if (!result) {
      Operation::fail(std::move(operation), result.error());
    } else if (!*result) {
      Operation::end(std::move(operation), net::error::eof);
    } else if constexpr (std::is_pointer_v<Item>) {
      Operation::post(std::move(operation), ErrorCode{}, *result);
    } else {
      Operation::post(std::move(operation), ErrorCode{}, std::move(**result));
    }
  }

  std::shared_ptr<detail::CallsState> calls_;
  std::unique_ptr<Begun> begun_;
};

}  // namespace RTPM_ASIO_FLAVOUR
}  // namespace rtpm::asio
