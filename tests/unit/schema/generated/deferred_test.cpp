#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "deferred.rtpm.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/test/os.hpp"

// Generated code of deferred methods, streams and oneways, over a real server.
namespace {

using namespace std::chrono_literals;
using rtpm::rpc::CallContext;
using rtpm::rpc::CallError;
using rtpm::rpc::Result;

class TestFeed final : public deferred::FeedServant {
 public:
  Result<void> nudge(const deferred::Sample& request, const CallContext&) override {
    nudged = request.number();
    return {};
  }
  Result<void> mark(const deferred::Note& request, const CallContext&) override {
    const rtpm::rt::AllowAllocationScope is_allowed;
    const std::lock_guard lock(mutex);
    marks.push_back(request.text()->str());
    return {};
  }
  Result<void> settle(const CallContext&) override {
    is_settled = true;
    return {};
  }
  void wait(rtpm::rpc::DeferredStruct<deferred::Sample> reply, const CallContext&) override {
    reply.complete(deferred::Sample{4, 0.5});
  }
  void rest(const deferred::Sample& request, rtpm::rpc::DeferredNothing reply,
            const CallContext&) override {
    if (request.number() == 0) {
      return reply.complete(rtpm::unexpected{rtpm::rpc::Refusal::kBadRequest});
    }
    reply.complete();
  }
  void describe(const deferred::Note& request, rtpm::rpc::DeferredTable<deferred::Note> reply,
                const CallContext&) override {
    auto builder = reply.builder();
    const auto text = builder.builder().CreateString("about " + request.text()->str());
    builder.finish(deferred::CreateNote(builder.builder(), text));
    reply.complete(builder);
  }
  void watch(rtpm::rpc::StructWriter<deferred::Sample> items, const CallContext&) override {
    const rtpm::rt::AllowAllocationScope is_allowed;
    worker = std::thread([items = std::move(items)]() mutable {
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
  }
  void log(const deferred::Note& request, rtpm::rpc::TableWriter<deferred::Note> items,
           const CallContext&) override {
    const rtpm::rt::AllowAllocationScope is_allowed;
    for (const char* end : {" one", " two"}) {
      flatbuffers::FlatBufferBuilder builder;
      builder.Finish(deferred::CreateNoteDirect(builder, (request.text()->str() + end).c_str()));
      EXPECT_TRUE(items.write(builder));
    }
    items.fail(rtpm::rpc::Refusal::kGone);
  }

  std::atomic<std::uint64_t> nudged{0};
  std::atomic<bool> is_settled{false};
  std::mutex mutex;
  std::vector<std::string> marks;
  std::thread worker;
};

class GeneratedDeferred : public testing::Test {
 protected:
  GeneratedDeferred() {
    rtpm::rpc::ServerConfig config;
    config.realtime = rtpm::rt::RealtimeMode::kOff;
    server_ = *rtpm::rpc::Server::create(config);
    EXPECT_TRUE(server_->add("feed", feed_));
    EXPECT_TRUE(server_->start());
    auto client = deferred::FeedClient::bind(node_, server_->url("feed"), {.deadline = 20s});
    EXPECT_TRUE(client) << client.error().text();
    client_.emplace(std::move(*client));
  }
  ~GeneratedDeferred() override {
    server_->stop();
    if (feed_.worker.joinable()) feed_.worker.join();
  }
  [[nodiscard]] static deferred::NoteT note(const std::string& text) {
    deferred::NoteT note;
    note.text = text;
    return note;
  }

  TestFeed feed_;
  std::unique_ptr<rtpm::rpc::Server> server_;
  rtpm::rpc::Node node_{[] {
    rtpm::rpc::NodeConfig config;
    config.default_deadline = 20s;
    return config;
  }()};
  std::optional<deferred::FeedClient> client_;
};

TEST_F(GeneratedDeferred, OnewaysWaitForTheirLevel) {
  ASSERT_TRUE(client_->nudge(deferred::Sample{17, 0}));
  EXPECT_TRUE(rtpm::test::await([&] { return feed_.nudged == 17; }));
  ASSERT_TRUE(client_->mark(note("here")));
  EXPECT_TRUE(rtpm::test::await([&] {
    const std::lock_guard lock(feed_.mutex);
    return feed_.marks == std::vector<std::string>{"here"};
  }));
  ASSERT_TRUE(client_->settle());
  EXPECT_TRUE(feed_.is_settled) << "its caller goes on when it ran";
}

TEST_F(GeneratedDeferred, RepliesAreDeferred) {
  const auto sample = client_->wait();
  ASSERT_TRUE(sample) << to_string(sample.error());
  EXPECT_EQ(sample->number(), 4u);
  EXPECT_TRUE(client_->rest(deferred::Sample{1, 0}));
  EXPECT_EQ(client_->rest(deferred::Sample{0, 0}).error(), CallError::kBadRequest);
  const auto text = client_->describe(note("it"));
  ASSERT_TRUE(text) << to_string(text.error());
  EXPECT_EQ((*text)->text()->str(), "about it");
}

TEST_F(GeneratedDeferred, StreamsOfStructsArriveInOrder) {
  auto samples = client_->watch();
  ASSERT_TRUE(samples) << to_string(samples.error());
  for (std::uint64_t i = 0; i < 100; ++i) {
    const auto sample = samples->next(rtpm::rt::now() + 20s);
    ASSERT_TRUE(sample) << to_string(sample.error());
    ASSERT_TRUE(sample->has_value()) << "too early an end";
    EXPECT_EQ((*sample)->number(), i);
  }
  const auto end = samples->next(rtpm::rt::now() + 20s);
  ASSERT_TRUE(end) << to_string(end.error());
  EXPECT_FALSE(end->has_value());
}

TEST_F(GeneratedDeferred, StreamsOfTablesMayEndWithARefusal) {
  auto notes = client_->log(note("line"));
  ASSERT_TRUE(notes) << to_string(notes.error());
  for (const char* wanted : {"line one", "line two"}) {
    const auto item = notes->next(rtpm::rt::now() + 20s);
    ASSERT_TRUE(item) << to_string(item.error());
    ASSERT_NE(*item, nullptr);
    EXPECT_EQ((*item)->text()->str(), wanted);
  }
  EXPECT_EQ(notes->next(rtpm::rt::now() + 20s).error(), CallError::kNoSuchObject);
}

TEST_F(GeneratedDeferred, StreamMethodsRefuseOrdinaryCalls) {
  const rtpm::rpc::MethodDescriptor watch{7, "watch", 0, false, {}};
  EXPECT_EQ(client_->binding().call(watch, {}).error(), CallError::kOverload);
}

}  // namespace
