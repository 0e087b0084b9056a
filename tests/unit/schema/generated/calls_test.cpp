#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "deferred.rtpm.functions.hpp"
#include "rtpm/rpc/completions.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/serve.hpp"

// Generated code of deferred methods, streams and oneways, called synchronously and asynchronously
// over a real server.
namespace {

using namespace std::chrono_literals;
using rtpm::rpc::CallContext;
using rtpm::rpc::CallError;
using rtpm::rt::now;

constexpr auto kPatience = 20s;

/// A feed whose replies wait until the test releases them.
class GeneratedCalls : public testing::Test {
 protected:
  GeneratedCalls() {
    server_ = rtpm::test::serve("feed", feed_);
    rtpm::rpc::NodeConfig node;
    node.default_deadline = kPatience;
    node_.emplace(node);
    auto client = deferred::FeedClient::bind(*node_, server_->url("feed"), {.deadline = kPatience});
    EXPECT_TRUE(client) << client.error().text();
    client_.emplace(std::move(*client));
  }
  ~GeneratedCalls() override {
    server_->stop();
    if (worker_.joinable()) worker_.join();
  }

  [[nodiscard]] static deferred::NoteT note(const std::string& text) {
    deferred::NoteT note;
    note.text = text;
    return note;
  }
  /// Replies to the oldest waiting call.
  void answer(double force) {
    ASSERT_TRUE(rtpm::test::await([&] {
      const std::lock_guard lock(mutex_);
      if (waiting_.empty()) return false;
      waiting_.front().complete(deferred::Sample{1, force});
      waiting_.erase(waiting_.begin());
      return true;
    }));
  }

  std::mutex mutex_;
  std::vector<rtpm::rpc::DeferredStruct<deferred::Sample>> waiting_;
  std::string marked_;
  std::atomic<std::uint64_t> nudged_{0};
  std::atomic<bool> is_settled_{false};
  std::thread worker_;
  deferred::FeedFunctionServant feed_{{
      .nudge = [this](const deferred::Sample& request,
                      const CallContext&) -> rtpm::rpc::Result<void> {
        nudged_ = request.number();
        return {};
      },
      .mark = [this](const deferred::Note& request, const CallContext&) -> rtpm::rpc::Result<void> {
        const rtpm::rt::AllowAllocationScope is_allowed;
        const std::lock_guard lock(mutex_);
        marked_ = request.text()->str();
        return {};
      },
      .settle = [this](const CallContext&) -> rtpm::rpc::Result<void> {
        is_settled_ = true;
        return {};
      },
      .wait =
          [this](rtpm::rpc::DeferredStruct<deferred::Sample> reply, const CallContext&) {
            const rtpm::rt::AllowAllocationScope is_allowed;
            const std::lock_guard lock(mutex_);
            waiting_.push_back(std::move(reply));
          },
      .rest =
          [](const deferred::Sample& request, rtpm::rpc::DeferredNothing reply,
             const CallContext&) {
            if (request.number() == 0) return reply.fail(rtpm::rpc::Refusal::kGone);
            reply.complete();
          },
      .describe =
          [](const deferred::Note& request, rtpm::rpc::DeferredTable<deferred::Note> reply,
             const CallContext&) {
            const rtpm::rt::AllowAllocationScope is_allowed;
            auto builder = reply.builder();
            // The request states the length.
            const std::string text(std::stoul(request.text()->str()), 'x');
            builder.finish(deferred::CreateNoteDirect(builder.builder(), text.c_str()));
            reply.complete(builder);
          },
      .watch =
          [this](rtpm::rpc::StructWriter<deferred::Sample> items, const CallContext&) {
            const rtpm::rt::AllowAllocationScope is_allowed;
            worker_ = std::thread([items = std::move(items)]() mutable {
              for (std::uint64_t i = 0; i < 100;) {
                if (items.write(deferred::Sample{i, 0.1 * static_cast<double>(i)})) {
                  ++i;
                } else if (!items.is_awaited()) {
                  break;
                } else {
                  std::this_thread::yield();
                }
              }
              items.finish();
            });
          },
      .log =
          [](const deferred::Note& request, rtpm::rpc::TableWriter<deferred::Note> items,
             const CallContext&) {
            const rtpm::rt::AllowAllocationScope is_allowed;
            flatbuffers::FlatBufferBuilder builder;
            const std::string text(std::stoul(request.text()->str()), 'x');
            builder.Finish(deferred::CreateNoteDirect(builder, text.c_str()));
            const auto written = items.write(builder);
            if (written && text.empty()) return items.fail(rtpm::rpc::Refusal::kGone);
            if (written) return items.finish();
            EXPECT_EQ(written.error(), rtpm::rpc::StreamError::kTooLarge);
            items.fail(rtpm::rpc::Refusal::kFailed);
          },
  }};
  std::unique_ptr<rtpm::rpc::Server> server_;
  std::optional<rtpm::rpc::Node> node_;
  std::optional<deferred::FeedClient> client_;
};

TEST_F(GeneratedCalls, OnewaysWaitForTheirLevel) {
  ASSERT_TRUE(client_->nudge(deferred::Sample{17, 0}));
  EXPECT_TRUE(rtpm::test::await([&] { return nudged_ == 17; }));
  ASSERT_TRUE(client_->mark(note("here")));
  EXPECT_TRUE(rtpm::test::await([&] {
    const std::lock_guard lock(mutex_);
    return marked_ == "here";
  }));
  ASSERT_TRUE(client_->settle());
  EXPECT_TRUE(is_settled_) << "its caller goes on when it ran";
}

TEST_F(GeneratedCalls, StreamsOfStructsArriveInOrder) {
  auto samples = client_->watch();
  ASSERT_TRUE(samples) << to_string(samples.error());
  for (std::uint64_t i = 0; i < 100; ++i) {
    const auto sample = samples->next(now() + kPatience);
    ASSERT_TRUE(sample) << to_string(sample.error());
    ASSERT_TRUE(sample->has_value()) << "too early an end";
    EXPECT_EQ((*sample)->number(), i);
  }
  const auto end = samples->next(now() + kPatience);
  ASSERT_TRUE(end) << to_string(end.error());
  EXPECT_FALSE(end->has_value());
}

TEST_F(GeneratedCalls, StreamsOfTablesMayEndWithARefusal) {
  auto notes = client_->log(note("0"));
  ASSERT_TRUE(notes) << to_string(notes.error());
  const auto item = notes->next(now() + kPatience);
  ASSERT_TRUE(item && *item);
  EXPECT_EQ(notes->next(now() + kPatience).error(), CallError::kNoSuchObject);
}

TEST_F(GeneratedCalls, StreamMethodsRefuseOrdinaryCalls) {
  const rtpm::rpc::MethodDescriptor watch{7, "watch", 0, false, {}};
  EXPECT_EQ(client_->binding().call(watch, {}).error(), CallError::kBadRequest);
}

TEST_F(GeneratedCalls, HandlesWaitForTheirReplies) {
  auto first = client_->begin_wait();
  auto second = client_->begin_wait();
  auto nothing = client_->begin_rest(deferred::Sample{1, 0});
  auto refused = client_->begin_rest(deferred::Sample{0, 0});
  auto table = client_->begin_describe(note("3"));
  ASSERT_TRUE(first && second && nothing && refused && table);
  EXPECT_FALSE(first->is_done());
  EXPECT_FALSE(second->wait(now() + 1ms));
  EXPECT_TRUE(nothing->take());
  EXPECT_EQ(refused->take().error(), CallError::kNoSuchObject);
  const auto text = table->take();
  ASSERT_TRUE(text);
  EXPECT_EQ((*text)->text()->str(), "xxx");
  answer(1);
  answer(2);
  EXPECT_TRUE(first->wait(now() + kPatience));
  const auto sample = first->take();
  const auto other = second->take();
  ASSERT_TRUE(sample && other);
  EXPECT_DOUBLE_EQ(sample->force_newton() + other->force_newton(), 3);
}

TEST_F(GeneratedCalls, AHandleMayCancelItsCall) {
  auto pending = client_->begin_wait();
  ASSERT_TRUE(pending);
  pending->cancel();
  EXPECT_TRUE(pending->is_done());
  EXPECT_EQ(pending->take().error(), CallError::kCancelled);
}

TEST_F(GeneratedCalls, CompletionsRunCallbacksWhereTheyArePolled) {
  rtpm::rpc::Completions completions;
  std::vector<double> forces;
  std::size_t others = 0;
  const auto keep = [&](const rtpm::expected<deferred::Sample, CallError>& sample) {
    ASSERT_TRUE(sample);
    forces.push_back(sample->force_newton());
  };
  completions.then(client_->begin_wait(), keep);
  completions.then(client_->begin_wait(), keep);
  completions.then(client_->begin_describe(note("1")), [&](const auto& text) {
    ASSERT_TRUE(text);
    others += (*text)->text()->size();
    // A callback may begin further calls.
    completions.then(client_->begin_rest(deferred::Sample{1, 0}),
                     [&](const auto& done) { others += done ? 10U : 0U; });
  });
  while (others < 11)
    ASSERT_GT(completions.wait(now() + kPatience), 0u);
  EXPECT_EQ(completions.open_count(), 2u);
  EXPECT_EQ(completions.poll(), 0u);
  EXPECT_EQ(completions.wait(now() + 1ms), 0u);
  answer(1);
  answer(2);
  while (completions.open_count() > 0)
    ASSERT_GT(completions.wait(now() + kPatience), 0u);
  EXPECT_EQ(forces.size(), 2u);
}

TEST_F(GeneratedCalls, CompletionsReportCancelledAndFailedCalls) {
  std::vector<CallError> errors;
  const auto keep = [&](const auto& result) { errors.push_back(result.error()); };
  {
    rtpm::rpc::Completions completions;
    completions.then(client_->begin_wait(), keep);
    completions.then(client_->begin_describe(note(std::string(300, '0'))), keep);
    EXPECT_EQ(completions.poll(), 1u);
    EXPECT_EQ(errors, std::vector{CallError::kTooLarge});
  }
  EXPECT_EQ(errors, (std::vector{CallError::kTooLarge, CallError::kCancelled}));
}

TEST_F(GeneratedCalls, CompletionsWaitForSingleItems) {
  rtpm::rpc::Completions completions;
  auto samples = client_->watch();
  ASSERT_TRUE(samples) << to_string(samples.error());
  std::vector<std::uint64_t> numbers;
  std::size_t cancelled_count = 0;
  for (int i = 0; i < 100; ++i) {
    const auto number = completions.then_next(*samples, [&](const auto& sample) {
      if (!sample) return void(++cancelled_count);
      numbers.push_back((*sample)->number());
    });
    if (i % 2 == 0) completions.cancel(number);
    while (completions.open_count() > 0)
      static_cast<void>(completions.wait(now() + kPatience));
  }
  EXPECT_EQ(numbers.size() + cancelled_count, 100u);
  ASSERT_GE(numbers.size(), 50u);
  for (std::uint64_t i = 0; i < numbers.size(); ++i)
    EXPECT_EQ(numbers[i], i) << "a cancelled wait loses no item";
  completions.then(client_->begin_wait(),
                   [&](const auto& sample) { cancelled_count += sample ? 0U : 1000U; });
  completions.cancel_all();
  EXPECT_GE(cancelled_count, 1000u);
  EXPECT_EQ(completions.open_count(), 0u);
}

TEST_F(GeneratedCalls, CompletionsRunCallbacksForItems) {
  rtpm::rpc::Completions completions;
  std::uint64_t number = 0;
  std::size_t size = 0;
  int end_count = 0;
  const auto on_end = [&](const rtpm::expected<void, CallError>& end) { end_count += end ? 1 : 0; };
  completions.then_each(
      client_->watch(),
      [&](const deferred::Sample& sample) { EXPECT_EQ(sample.number(), number++); }, on_end);
  completions.then_each(
      client_->log(note("64")), [&](const deferred::Note& note) { size += note.text()->size(); },
      on_end);
  while (completions.open_count() > 0)
    ASSERT_GT(completions.wait(now() + kPatience), 0u);
  EXPECT_EQ(number, 100u);
  EXPECT_EQ(size, 64u);
  EXPECT_EQ(end_count, 2);
}

TEST_F(GeneratedCalls, ACompletionThreadRunsCallbacksByItself) {
  auto thread = rtpm::rpc::CompletionThread::start({.name = "replies"});
  ASSERT_TRUE(thread) << thread.error().text();
  std::atomic<double> force{0};
  std::atomic<bool> is_cancelled{false};
  std::atomic<std::thread::id> ran_by{};
  (*thread)->then(client_->begin_wait(), [&](const auto& sample) {
    ran_by = std::this_thread::get_id();
    if (sample) force = sample->force_newton();
  });
  answer(0.5);
  EXPECT_TRUE(rtpm::test::await([&] { return force == 0.5; }));
  EXPECT_NE(ran_by.load(), std::this_thread::get_id());
  (*thread)->then(client_->begin_wait(), [&](const auto& sample) {
    is_cancelled = !sample && sample.error() == CallError::kCancelled;
  });
  thread->reset();
  EXPECT_TRUE(is_cancelled);
}

TEST_F(GeneratedCalls, MalformedRequestsAreCounted) {
  const rtpm::rpc::MethodDescriptor mark{.id = 2, .name = "mark"};
  const std::array<std::byte, 3> garbage{};
  EXPECT_EQ(client_->binding().call(mark, garbage).error(), CallError::kBadRequest);
  // A lane publishes its counts after its reply.
  EXPECT_TRUE(rtpm::test::await([&] { return server_->counters().bad_request_count == 1; }));
}

// rtpm_max_size applies to deferred replies and items, too.
TEST_F(GeneratedCalls, RepliesAndItemsAboveTheirMaximumSizeAreRefused) {
  EXPECT_TRUE(client_->describe(note("200")));
  EXPECT_EQ(client_->describe(note("256")).error(), CallError::kTooLarge);
  auto fits = client_->log(note("64"));
  auto too_large = client_->log(note("128"));
  ASSERT_TRUE(fits && too_large);
  const auto item = fits->next(now() + kPatience);
  ASSERT_TRUE(item && *item);
  EXPECT_EQ((*item)->text()->size(), 64u);
  EXPECT_EQ(too_large->next(now() + kPatience).error(), CallError::kTooLarge)
      << "that is why it failed";
}

}  // namespace
