#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#ifdef RTPM_ASIO_BOOST
#include <boost/asio/bind_executor.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/thread_pool.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/asio/use_future.hpp>
#if __has_include(<boost/asio/experimental/as_tuple.hpp>)
#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/experimental/as_tuple.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/experimental/deferred.hpp>
#endif
#else
#include <asio/bind_cancellation_slot.hpp>
#include <asio/bind_executor.hpp>
#include <asio/co_spawn.hpp>
#include <asio/experimental/as_tuple.hpp>
#include <asio/experimental/awaitable_operators.hpp>
#include <asio/experimental/deferred.hpp>
#include <asio/redirect_error.hpp>
#include <asio/steady_timer.hpp>
#include <asio/thread_pool.hpp>
#include <asio/use_awaitable.hpp>
#include <asio/use_future.hpp>
#endif

#include "deferred.rtpm.functions.hpp"
#include "rtpm/asio/asio.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/events/hub_server.hpp"
#include "rtpm/events/supplier.hpp"
#include "rtpm/names/servant.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/serve.hpp"
#include "shared.rtpm.functions.hpp"

// Compiled twice, see CMakeLists.txt: with standalone Asio and with Boost.Asio.
namespace rtpm::asio {
namespace {

using namespace std::chrono_literals;
using rpc::CallContext;
using rpc::CallError;
using Sample = deferred::Sample;

constexpr auto kPatience = 20s;

deferred::NoteT note(const std::string& text) {
  deferred::NoteT note;
  note.text = text;
  return note;
}

/// A feed whose replies and items come when a test says so, and an Asio loop that calls it.
class Asio : public testing::Test {
 protected:
  Asio() {
    rpc::NodeConfig config;
    config.default_deadline = kPatience;
    config.wait.strategy = rt::WaitStrategy::kBlock;
    node_.emplace(config);
    auto feed = deferred::FeedClient::bind(*node_, server_->url("feed"), {.deadline = kPatience});
    EXPECT_TRUE(feed) << feed.error().text();
    feed_.emplace(std::move(*feed));
  }

  /// Starts a coroutine whose exceptions end the loop. The same type for all saves compile time.
  using Coroutine = std::function<net::awaitable<void>()>;
  void spawn(Coroutine function) {
    net::co_spawn(loop_, std::move(function), [](std::exception_ptr error) {
      if (error) std::rethrow_exception(error);
    });
  }
  /// Runs the loop until nothing is left to wait for.
  void run() {
    loop_.restart();
    loop_.run_for(kPatience);
    EXPECT_TRUE(loop_.stopped()) << "something is left to wait for";
  }
  [[nodiscard]] bool has_waiting() {
    const std::lock_guard lock(mutex_);
    return !waiting_.empty();
  }
  /// Replies to the oldest waiting call, which must come.
  void answer(double force) {
    ASSERT_TRUE(test::await([&] { return has_waiting(); }));
    const std::lock_guard lock(mutex_);
    waiting_.front().complete(Sample{1, force});
    waiting_.erase(waiting_.begin());
  }
  /// Whether the server hears that the oldest waiting call was cancelled.
  [[nodiscard]] bool hears_of_cancellation() {
    return test::await([&] {
      const std::lock_guard lock(mutex_);
      return !waiting_.empty() && !waiting_.front().is_awaited();
    });
  }
  /// The items of the stream, which must be open.
  [[nodiscard]] rpc::StructWriter<Sample>& writer() {
    EXPECT_TRUE(test::await([&] {
      const std::lock_guard lock(mutex_);
      return static_cast<bool>(writer_);
    }));
    return writer_;
  }

  std::mutex mutex_{};
  std::vector<rpc::DeferredStruct<Sample>> waiting_{};
  rpc::StructWriter<Sample> writer_{};
  deferred::FeedFunctionServant servant_{{
      .nudge = [](const Sample&, const CallContext&) { return rpc::Result<void>{}; },
      .mark = [](const deferred::Note&, const CallContext&) { return rpc::Result<void>{}; },
      .settle = [](const CallContext&) { return rpc::Result<void>{}; },
      .wait =
          [this](rpc::DeferredStruct<Sample> reply, const CallContext&) {
            const rt::AllowAllocationScope is_allowed;
            const std::lock_guard lock(mutex_);
            waiting_.push_back(std::move(reply));
          },
      .rest =
          [](const Sample& request, rpc::DeferredNothing reply, const CallContext&) {
            if (request.number() == 0) return reply.fail(rpc::Refusal::kGone);
            reply.complete();
          },
      .describe =
          [](const deferred::Note& request, rpc::DeferredTable<deferred::Note> reply,
             const CallContext&) {
            const rt::AllowAllocationScope is_allowed;
            auto builder = reply.builder();
            const std::string text(std::stoul(request.text()->str()), 'x');
            builder.finish(deferred::CreateNoteDirect(builder.builder(), text.c_str()));
            reply.complete(builder);
          },
      .watch =
          [this](rpc::StructWriter<Sample> items, const CallContext&) {
            const std::lock_guard lock(mutex_);
            writer_ = std::move(items);
          },
      .log =
          [](const deferred::Note& request, rpc::TableWriter<deferred::Note> items,
             const CallContext&) {
            const rt::AllowAllocationScope is_allowed;
            flatbuffers::FlatBufferBuilder builder;
            builder.Finish(deferred::CreateNoteDirect(builder, request.text()->c_str()));
            static_cast<void>(items.write(builder));
            items.fail(rpc::Refusal::kGone);
          },
  }};
  std::unique_ptr<rpc::Server> server_ = test::serve("feed", servant_);
  std::optional<rpc::Node> node_{};
  std::optional<deferred::FeedClient> feed_{};
  net::io_context loop_{};
};

// ---- calls --------------------------------------------------------------------------------------

TEST_F(Asio, CallsCompleteByCallback) {
  Calls calls(loop_);
  double force = 0;
  bool is_done = false;
  std::size_t size = 0;
  calls.async_call(feed_->begin_wait(), [&](ErrorCode error, Sample sample) {
    EXPECT_FALSE(error) << error.message();
    force = sample.force_newton();
  });
  calls.async_call(feed_->begin_rest(Sample{1, 0}), [&](ErrorCode error) { is_done = !error; });
  calls.async_call(feed_->begin_describe(note("3")), [&](ErrorCode error, auto text) {
    EXPECT_FALSE(error) << error.message();
    size = text->text()->size();
  });
  answer(7);
  EXPECT_FALSE(is_done) << "handlers run in the loop";
  run();
  EXPECT_EQ(force, 7);
  EXPECT_TRUE(is_done);
  EXPECT_EQ(size, 3u);
}

TEST_F(Asio, CallsAreAwaitable) {
  Calls calls(loop_);
  std::vector<double> forces;
  spawn([&]() -> net::awaitable<void> {
    for (int i = 0; i < 3; ++i) {
      auto begun = feed_->begin_wait();
      answer(i);
      const Sample sample = co_await calls.async_call(std::move(begun), net::use_awaitable);
      forces.push_back(sample.force_newton());
    }
    co_await calls.async_call(feed_->begin_rest(Sample{1, 0}), net::use_awaitable);
    const auto text =
        co_await calls.async_call(feed_->begin_describe(note("2")), net::use_awaitable);
    forces.push_back(static_cast<double>(text->text()->size()));
  });
  run();
  EXPECT_EQ(forces, (std::vector<double>{0, 1, 2, 2}));
}

TEST_F(Asio, CallsCompleteAsFutures) {
  Calls calls(loop_);
  auto sample = calls.async_call(feed_->begin_wait(), net::use_future);
  auto gone = calls.async_call(feed_->begin_rest(Sample{0, 0}), net::use_future);
  answer(7);
  run();
  EXPECT_EQ(sample.get().force_newton(), 7);
  EXPECT_ANY_THROW(gone.get());
}

TEST_F(Asio, ErrorsAreThoseOfTheCall) {
  Calls calls(loop_);
  int error_count = 0;
  const auto expect = [&](CallError wanted) {
    return [&error_count, wanted](const ErrorCode& error, auto&&...) {
      EXPECT_TRUE(error);
      EXPECT_EQ(error, code_of(wanted)) << error.message();
      EXPECT_EQ(error_of(error), wanted);
      EXPECT_EQ(error.message(), to_string(wanted));
      ++error_count;
    };
  };
  calls.async_call(feed_->begin_rest(Sample{0, 0}), expect(CallError::kNoSuchObject));
  calls.async_call(feed_->begin_wait({}, {.deadline = 10ms}), expect(CallError::kTimeout));
  calls.async_call(feed_->begin_describe(note(std::string(300, '0'))),
                   expect(CallError::kTooLarge));
  run();
  EXPECT_EQ(error_count, 3);
  EXPECT_FALSE(error_of(ErrorCode{}));
  EXPECT_FALSE(error_of(net::error::eof));
}

TEST_F(Asio, CoroutinesGetErrorsAsExceptionsOrValues) {
  lab::safety::BrakeFunctionServant servant{{
      .hold = [](const lab::Force&, const CallContext&) { return rpc::Result<void>{}; },
      .stop =
          [](const CallContext&) {
            static_cast<void>(std::stoul("not a number"));  // Throws.
            return rpc::Result<void>{};
          },
  }};
  const auto server = test::serve("brake", servant);
  auto brake = lab::safety::BrakeClient::bind(*node_, server->url("brake"));
  ASSERT_TRUE(brake) << brake.error().text();
  Calls calls(loop_);
  ErrorCode error;
  std::string reason;
  std::string thrown;
  spawn([&]() -> net::awaitable<void> {
    co_await calls.async_call(brake->begin_stop(), net::redirect_error(net::use_awaitable, error));
    reason = rpc::describe(*error_of(error));
    try {
      co_await calls.async_call(feed_->begin_rest(Sample{0, 0}), net::use_awaitable);
    } catch (const std::exception& failed) {
      thrown = failed.what();
    }
  });
  run();
  EXPECT_EQ(error, code_of(CallError::kServantFailed));
  EXPECT_NE(reason.find("stoul"), std::string::npos) << "the servant's own words: " << reason;
  EXPECT_NE(thrown.find(to_string(CallError::kNoSuchObject)), std::string::npos) << thrown;
}

TEST_F(Asio, HandlersRunByTheirExecutor) {
  Calls calls(loop_);
  net::thread_pool pool(1);
  std::atomic<std::thread::id> thread{};
  // The pool is kept from ending by the open call.
  calls.async_call(feed_->begin_rest(Sample{1, 0}),
                   net::bind_executor(pool.get_executor(),
                                      [&](ErrorCode) { thread = std::this_thread::get_id(); }));
  std::thread runner([&] { run(); });
  pool.join();
  runner.join();
  EXPECT_NE(thread.load(), std::thread::id{});
  EXPECT_NE(thread.load(), std::this_thread::get_id());
}

TEST_F(Asio, SeveralThreadsMayRunTheLoop) {
  Calls calls(loop_);
  constexpr int kCallCount = 40;
  std::atomic<int> count{0};
  for (int i = 0; i < 4; ++i) {
    spawn([&]() -> net::awaitable<void> {
      for (int call = 0; call < kCallCount; ++call) {
        co_await calls.async_call(feed_->begin_rest(Sample{1, 0}), net::use_awaitable);
        ++count;
      }
    });
  }
  std::vector<std::thread> threads;
  for (int i = 0; i < 3; ++i)
    threads.emplace_back([&] { loop_.run(); });
  run();
  for (std::thread& thread : threads)
    thread.join();
  EXPECT_EQ(count, 4 * kCallCount);
}

TEST_F(Asio, DestructionOfCallsCancelsThem) {
  int count = 0;
  {
    Calls calls(loop_);
    calls.async_call(feed_->begin_wait(), [&](ErrorCode error, auto) {
      EXPECT_EQ(error, net::error::operation_aborted);
      ++count;
    });
    Calls moved(std::move(calls));
  }
  run();
  EXPECT_EQ(count, 1);
  EXPECT_TRUE(hears_of_cancellation());
}

TEST_F(Asio, CancelEndsOpenCallsAndAllowsOthers) {
  Calls calls(loop_);
  int aborted_count = 0;
  int done_count = 0;
  for (int i = 0; i < 2; ++i) {
    calls.async_call(feed_->begin_wait(), [&](ErrorCode error, auto) {
      aborted_count += error == net::error::operation_aborted ? 1 : 0;
    });
  }
  loop_.poll();
  calls.cancel();
  calls.async_call(feed_->begin_rest(Sample{1, 0}),
                   [&](ErrorCode error) { done_count += error ? 0 : 1; });
  run();
  EXPECT_EQ(aborted_count, 2);
  EXPECT_EQ(done_count, 1);
}

TEST_F(Asio, SetUpDoesNotHoldUpTheLoop) {
  Calls calls(loop_);
  std::atomic<bool> is_held{true};
  std::string text;
  bool is_bound = false;
  spawn([&]() -> net::awaitable<void> {
    co_await calls.async_set_up([&] { return test::await([&] { return !is_held.load(); }); },
                                net::use_awaitable);
    auto feed = co_await calls.async_set_up(
        [&] { return deferred::FeedClient::bind(*node_, server_->url("feed")); },
        net::use_awaitable);
    is_bound = feed.has_value();
    const auto none = co_await calls.async_set_up(
        [&] { return deferred::FeedClient::bind(*node_, server_->url("none")); },
        net::use_awaitable);
    if (!none) text = none.error().text();
  });
  net::post(loop_, [&] { is_held = false; });
  run();
  EXPECT_TRUE(is_bound);
  EXPECT_NE(text.find("none"), std::string::npos) << text;
}

// ---- streams ------------------------------------------------------------------------------------

TEST_F(Asio, StreamsYieldItemsInOrderUntilTheirEnd) {
  Calls calls(loop_);
  std::vector<std::uint64_t> numbers;
  ErrorCode end;
  Stream samples(calls, feed_->watch());
  std::thread worker([&writer = writer()] {
    for (std::uint64_t i = 0; i < 100;) {
      if (writer.write(Sample{i, 0})) {
        ++i;
      } else if (!writer.is_awaited()) {
        break;
      } else {
        std::this_thread::yield();
      }
    }
    writer.finish();
  });
  spawn([&]() -> net::awaitable<void> {
    while (true) {
      const Sample sample =
          co_await samples.async_next(net::redirect_error(net::use_awaitable, end));
      if (end) break;
      numbers.push_back(sample.number());
    }
  });
  run();
  worker.join();
  EXPECT_EQ(end, net::error::eof);
  ASSERT_EQ(numbers.size(), 100u);
  for (std::uint64_t i = 0; i < numbers.size(); ++i)
    EXPECT_EQ(numbers[i], i);
}

TEST_F(Asio, StreamsOfTablesMayEndWithARefusal) {
  Calls calls(loop_);
  std::string text;
  ErrorCode end;
  Stream notes(calls, feed_->log(note("hello")));
  Stream refused(calls, feed_->log(note(std::string(300, 'x'))));
  ErrorCode refusal;
  spawn([&]() -> net::awaitable<void> {
    const deferred::Note* const item = co_await notes.async_next(net::use_awaitable);
    text = item->text()->str();
    co_await notes.async_next(net::redirect_error(net::use_awaitable, end));
    co_await refused.async_next(net::redirect_error(net::use_awaitable, refusal));
  });
  run();
  EXPECT_EQ(text, "hello");
  EXPECT_EQ(end, code_of(CallError::kNoSuchObject));
  EXPECT_EQ(refusal, code_of(CallError::kTooLarge));
}

TEST_F(Asio, DestructionOfAStreamCancelsIt) {
  Calls calls(loop_);
  ErrorCode end;
  {
    Stream samples(calls, feed_->watch());
    samples.async_next([&](ErrorCode error, auto) { end = error; });
    loop_.poll();
    static_cast<void>(writer());
  }
  run();
  EXPECT_EQ(end, net::error::operation_aborted);
  EXPECT_TRUE(test::await([&] { return !writer_.is_awaited(); }));
}

// ---- cancellation slots -------------------------------------------------------------------------

#ifdef RTPM_ASIO_HAS_SLOTS
constexpr auto kAsTuple = net::experimental::as_tuple(net::use_awaitable);

TEST_F(Asio, ASlotCancelsItsCallOnly) {
  Calls calls(loop_);
  net::cancellation_signal signal;
  ErrorCode cancelled;
  double force = 0;
  calls.async_call(feed_->begin_wait(),
                   net::bind_cancellation_slot(signal.slot(),
                                               [&](ErrorCode error, auto) { cancelled = error; }));
  ASSERT_TRUE(test::await([&] { return has_waiting(); }));
  calls.async_call(feed_->begin_wait(),
                   [&](ErrorCode, Sample sample) { force = sample.force_newton(); });
  signal.emit(net::cancellation_type::total);
  loop_.poll();
  EXPECT_FALSE(cancelled) << "a call may have side effects";
  signal.emit(net::cancellation_type::terminal);
  EXPECT_FALSE(cancelled) << "handlers run in the loop";
  loop_.poll();
  EXPECT_EQ(cancelled, net::error::operation_aborted);
  ASSERT_TRUE(hears_of_cancellation());
  waiting_.erase(waiting_.begin());
  answer(7);
  run();
  EXPECT_EQ(force, 7);
  signal.emit(net::cancellation_type::terminal);
}

TEST_F(Asio, CancellingAWaitLosesNoItem) {
  using namespace net::experimental::awaitable_operators;
  Calls calls(loop_);
  Stream samples(calls, feed_->watch());
  std::uint64_t number = 0;
  bool was_first = true;
  spawn([&]() -> net::awaitable<void> {
    net::steady_timer timer(loop_, 1ms);
    const auto first =
        co_await (samples.async_next(kAsTuple) || timer.async_wait(net::use_awaitable));
    was_first = first.index() == 0;
    EXPECT_TRUE(writer().write(Sample{42, 0}));
    const Sample sample = co_await samples.async_next(net::use_awaitable);
    number = sample.number();
  });
  run();
  EXPECT_FALSE(was_first);
  EXPECT_EQ(number, 42u);
}

TEST_F(Asio, DeferredCallsMayBeStartedLater) {
  Calls calls(loop_);
  auto later = calls.async_call(feed_->begin_rest(Sample{1, 0}), net::experimental::deferred);
  bool is_done = false;
  std::move(later)([&](ErrorCode error) { is_done = !error; });
  run();
  EXPECT_TRUE(is_done);
}
#endif

// ---- events and names ---------------------------------------------------------------------------

constexpr events::EventType kPose = 5;
constexpr events::EventDescriptor kPoseType{kPose, "lab.Pose", 0x1111, {}};

class AsioEvents : public Asio {
 protected:
  AsioEvents() {
    events::HubConfig config;
    config.realtime = rt::RealtimeMode::kOff;
    config.priority.reset();
    hub_ = test::made(events::Hub::create(config));
    hub_server_ = test::serve(events::kHubPath, hub_->servant(), events::server_config_for(config));
    supplier_ = test::made(events::Supplier::create(*hub_, {.types = {&kPoseType}}));
  }
  ~AsioEvents() override {
    supplier_.reset();
    hub_server_->stop();
  }
  [[nodiscard]] std::unique_ptr<events::Consumer> subscribe(events::EventHandler& handler) {
    return test::made(events::Consumer::create(*node_, hub_server_->url(events::kHubPath),
                                               {.filter = events::of_type(kPose),
                                                .realtime = rt::RealtimeMode::kOff,
                                                .deadline = kPatience},
                                               handler));
  }
  void push(std::uint32_t source) {
    const std::array payload{std::byte{1}, std::byte{2}};
    const auto pushed =
        supplier_->push({.type = kPose, .source = source, .schema_id = 0x1111, .payload = payload});
    EXPECT_TRUE(pushed) << to_string(pushed.error());
  }

  std::unique_ptr<events::Hub> hub_{};
  std::unique_ptr<rpc::Server> hub_server_{};
  std::unique_ptr<events::Supplier> supplier_{};
};

TEST_F(AsioEvents, EventsAndNoticesAreAwaitable) {
  EventQueue arrivals(loop_);
  std::vector<std::uint32_t> sources;
  std::vector<events::NoticeKind> notices;
  std::size_t size = 0;
  ErrorCode end;
  spawn([&]() -> net::awaitable<void> {
    const auto consumer = subscribe(arrivals);
    push(0);
    while (true) {
      const EventNews news =
          co_await arrivals.async_next(net::redirect_error(net::use_awaitable, end));
      if (end) break;
      if (news.notice) notices.push_back(news.notice->notice.kind);
      for (const Event& event : news.events) {
        sources.push_back(event.header.source);
        size = event.payload.size();
        if (sources.size() < 5) {
          push(static_cast<std::uint32_t>(sources.size()));
        } else {
          consumer->unsubscribe();
        }
      }
    }
  });
  run();
  EXPECT_EQ(sources, (std::vector<std::uint32_t>{0, 1, 2, 3, 4}));
  EXPECT_EQ(size, 2u);
  EXPECT_EQ(end, net::error::eof);
  ASSERT_FALSE(notices.empty());
  EXPECT_EQ(notices.front(), events::NoticeKind::kSubscribed);
  EXPECT_EQ(notices.back(), events::NoticeKind::kEnded);
}

TEST_F(AsioEvents, AFullQueueDropsTheOldestAndCounts) {
  EventQueue arrivals(loop_, {.count_max = 2});
  const auto consumer = subscribe(arrivals);
  for (std::uint32_t i = 0; i < 5; ++i)
    push(i);
  // The first is the notice that events arrive.
  ASSERT_TRUE(test::await([&] { return arrivals.dropped_count() == 4; }));
  std::vector<std::uint32_t> sources;
  for (int i = 0; i < 2; ++i) {
    arrivals.async_next([&](ErrorCode error, const EventNews& news) {
      EXPECT_FALSE(error);
      for (const Event& event : news.events)
        sources.push_back(event.header.source);
    });
  }
  ErrorCode cancelled;
  arrivals.async_next([&](ErrorCode error, const EventNews&) { cancelled = error; });
  arrivals.cancel();
  run();
  EXPECT_EQ(sources, (std::vector<std::uint32_t>{3, 4}));
  EXPECT_EQ(cancelled, net::error::operation_aborted);
}

TEST_F(Asio, WatchedNamesAreAwaitable) {
  const auto registry = names::make_servant();
  const auto server = test::serve(names::kRegistryPath, *registry, {.stream_count_max = 8});
  const std::string url = server->url(names::kRegistryPath);
  names::Directory directory(*node_, url);
  const auto bind = [&](std::string_view name, std::string_view at) {
    const auto bound = directory.bind({name, at, "lab.Arm", {.id = 1, .epoch = 1}, 10s});
    EXPECT_TRUE(bound) << bound.error().text();
  };
  bind("lab/arm0", "rtpm://127.0.0.1:4711/object");
  NameQueue names(loop_);
  std::vector<std::string> texts;
  const auto watch = test::made(names::NameWatch::start(*node_, url, {}, names.handlers()));
  spawn([&]() -> net::awaitable<void> {
    while (texts.size() < 4) {
      const NameNews news = co_await names.async_next(net::use_awaitable);
      constexpr std::array kWords{"bound ", "changed ", "gone "};
      if (news.change) {
        texts.push_back(kWords.at(static_cast<std::size_t>(news.change->kind)) +
                        news.change->entry.name);
        if (texts.size() == 4) break;
      }
      if (news.has_all) {
        texts.emplace_back("all");
        bind("lab/arm0", "rtpm://127.0.0.1:4712/object");
      } else if (texts.size() == 3) {
        EXPECT_TRUE(directory.unbind("lab/arm0", {.id = 1, .epoch = 1}));
      }
    }
  });
  run();
  EXPECT_EQ(texts, (std::vector<std::string>{"bound lab/arm0", "all", "changed lab/arm0",
                                             "gone lab/arm0"}));
}

TEST_F(Asio, OfANameThatChangesOftenTheLastChangeIsReported) {
  NameQueue names(loop_);
  const auto handlers = names.handlers();
  const auto change = [&](std::string_view name, names::NameChange::Kind kind) {
    names::NameChange changed{.kind = kind};
    changed.entry.name = name;
    handlers.on_change(changed);
  };
  for (int i = 0; i < 100; ++i) {
    change("lab/arm0", names::NameChange::Kind::kChanged);
    change("lab/arm1", names::NameChange::Kind::kChanged);
  }
  change("lab/arm0", names::NameChange::Kind::kGone);
  std::vector<NameNews> all;
  for (int i = 0; i < 2; ++i)
    names.async_next([&](ErrorCode, NameNews news) { all.push_back(std::move(news)); });
  run();
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].change->kind, names::NameChange::Kind::kGone);
  EXPECT_EQ(all[1].change->entry.name, "lab/arm1");
}

// ---- the end ------------------------------------------------------------------------------------

TEST_F(AsioEvents, DestructionOfTheLoopLeavesNothingBehind) {
  // Lives as long as one of the coroutines, which own all that they wait for.
  const auto token = std::make_shared<int>();
  {
    net::io_context loop;
    const auto spawn = [&](Coroutine function) {
      net::co_spawn(loop, std::move(function), [](std::exception_ptr) {});
    };
    spawn([this, &loop, token]() -> net::awaitable<void> {
      Calls calls(loop);
      co_await calls.async_call(feed_->begin_wait(), net::use_awaitable);
    });
    spawn([this, &loop, token]() -> net::awaitable<void> {
      Calls calls(loop);
      Stream samples(calls, feed_->watch());
      co_await samples.async_next(net::use_awaitable);
    });
    spawn([this, &loop, token]() -> net::awaitable<void> {
      EventQueue arrivals(loop);
      const auto consumer = subscribe(arrivals);
      while (true)
        co_await arrivals.async_next(net::use_awaitable);
    });
    bool has_begun = false;
    spawn([&loop, &has_begun, token]() -> net::awaitable<void> {
      Calls calls(loop);
      // A variable, because GCC 12 would destroy it twice in the expression.
      auto set_up = [token] {
        std::this_thread::sleep_for(10ms);
        return 0;
      };
      has_begun = true;
      co_await calls.async_set_up(std::move(set_up), net::use_awaitable);
    });
    while (!has_begun)
      loop.run_one();
    EXPECT_GT(token.use_count(), 4);
  }
  EXPECT_EQ(token.use_count(), 1);
  EXPECT_TRUE(hears_of_cancellation());
}

TEST_F(Asio, ObjectsMayOutliveTheLoop) {
  auto loop = std::make_unique<net::io_context>();
  int count = 0;
  Calls calls(*loop);
  Stream samples(calls, feed_->watch());
  Queue<int> numbers(*loop);
  calls.async_call(feed_->begin_wait(), [&](ErrorCode, auto) { ++count; });
  samples.async_next([&](ErrorCode, auto) { ++count; });
  numbers.async_next([&](ErrorCode, auto) { ++count; });
  loop->poll();
  loop.reset();
  numbers.push(1);
  calls.cancel();
  EXPECT_EQ(count, 0);
}

}  // namespace
}  // namespace rtpm::asio
