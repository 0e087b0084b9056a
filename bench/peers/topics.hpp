#pragma once

#include <deque>
#include <memory>

#include "peer.hpp"

/// Calls and events by middleware that has only topics: a request on one, its reply on another.
namespace rtpm::bench {

enum class TopicRole : std::uint8_t { kServer, kCaller, kSupplier, kConsumer };

/// All that such a peer does. `Middleware` has, each with bool is_well():
///   Context(lane, role)          what one thread waits with; bool wait(patience), which is
///                                Duration::max() for no end
///   Reader<S>(context, topic, depth)  of samples S, as many as `depth` kept; bool take(S&)
///   Writer<S>(context, topic, depth)  bool write(const S&)
///   kName, kRemedy               of the library, and of a set-up that fails
template <class Middleware>
class TopicPeer {
 public:
  static Outcome<> serve(const PeerLane& lane, const Announce& announce) {
    Context context(lane, TopicRole::kServer);
    std::deque<End> ends;
    for (int caller = 0; caller < lane.connection_count; ++caller) {
      const End& end = ends.emplace_back(context, topic_name(lane, caller, "request"),
                                         topic_name(lane, caller, "reply"));
      if (!end.is_well()) return library_failure("set-up");
    }
    announce("by name");
    for (PeerMessage message;;) {
      context.wait(Duration::max());
      for (End& end : ends) {
        while (end.reader.take(message)) {
          answer(message.work_ns);
          end.writer.write(message);
        }
      }
    }
  }

  /// Calls until an answer comes: messages sent before the two have found each other are lost. Then
  /// waits until no late reply is left.
  static Outcome<Exchange> connect(const PeerLane& lane, const std::string&) {
    auto caller = std::make_shared<CallerEnd>(lane);
    if (!caller->end.is_well()) return library_failure("set-up");
    const MonotonicTime give_up = rt::now() + std::chrono::seconds{8};
    for (PeerMessage reply; rt::now() < give_up;) {
      if (!caller->end.writer.write({})) return library_failure("write");
      if (!caller->receive(reply, std::chrono::milliseconds{100})) continue;
      while (caller->receive(reply, std::chrono::milliseconds{200})) {
      }
      return [caller](const PeerMessage& request, PeerMessage& got) -> Outcome<> {
        if (!caller->end.writer.write(request)) return library_failure("write");
        if (caller->receive(got, std::chrono::seconds{1})) return {};
        return failure("no reply in 1 s");
      };
    }
    return failure("no answer to any request within 8 s");
  }

  static Outcome<Push> connect_supplier(const PeerLane& lane, const std::string&) {
    auto& context = *new Context(lane, TopicRole::kSupplier);
    auto writer = std::make_shared<Writer<EventStamp>>(context, kEventTopic, kEventQueueMax);
    if (!writer->is_well()) return library_failure("set-up");
    return [writer](const EventStamp& stamp) -> Outcome<> {
      if (!writer->write(stamp)) return library_failure("write");
      return {};
    };
  }

  static Outcome<Consume> connect_consumer(const PeerLane& lane, const std::string&, Note& note) {
    auto& context = *new Context(lane, TopicRole::kConsumer);
    auto reader = std::make_shared<Reader<EventStamp>>(context, kEventTopic, kEventQueueMax);
    if (!reader->is_well()) return library_failure("set-up");
    return [reader, &context, &note] {
      for (EventStamp stamp;;) {
        context.wait(Duration::max());
        while (reader->take(stamp))
          note(&stamp, sizeof stamp);
      }
    };
  }

 private:
  using Context = typename Middleware::Context;
  template <class Sample>
  using Reader = typename Middleware::template Reader<Sample>;
  template <class Sample>
  using Writer = typename Middleware::template Writer<Sample>;
  static constexpr const char* kEventTopic = "rtpm_bench_events";

  /// One end of a caller's two topics, of which only the last sample counts.
  struct End {
    End(Context& context, const std::string& reads, const std::string& writes)
        : reader(context, reads, 1), writer(context, writes, 1) {}
    [[nodiscard]] bool is_well() const { return reader.is_well() && writer.is_well(); }
    Reader<PeerMessage> reader;
    Writer<PeerMessage> writer;
  };

  struct CallerEnd {
    explicit CallerEnd(const PeerLane& lane)
        : context(lane, TopicRole::kCaller),
          end(context, topic_name(lane, lane.caller, "reply"),
              topic_name(lane, lane.caller, "request")) {}
    /// False if nothing came in time.
    [[nodiscard]] bool receive(PeerMessage& reply, Duration patience) {
      const MonotonicTime give_up = rt::now() + patience;
      while (!end.reader.take(reply)) {
        if (rt::now() > give_up) return false;
        context.wait(patience);
      }
      return true;
    }
    Context context;
    End end;
  };

  /// Each caller has two topics of its own, so that a reply reaches it alone.
  [[nodiscard]] static std::string topic_name(const PeerLane& lane, int caller, const char* what) {
    return "rtpm_bench_lane" + std::to_string(lane.index) + "_caller" + std::to_string(caller) +
           "_" + what;
  }
  [[nodiscard]] static auto library_failure(const char* what) {
    return failure_of(Middleware::kName, what, Middleware::kRemedy);
  }
};

template <class Middleware>
inline constexpr Peer kTopicPeer{.serve = TopicPeer<Middleware>::serve,
                                 .connect = TopicPeer<Middleware>::connect,
                                 .connect_supplier = TopicPeer<Middleware>::connect_supplier,
                                 .connect_consumer = TopicPeer<Middleware>::connect_consumer};

}  // namespace rtpm::bench
