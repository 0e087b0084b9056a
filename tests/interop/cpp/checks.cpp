#include "checks.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <mutex>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "interop.rtpm.events.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/registration.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::interop {
namespace {

using rpc::CallError;
using std::chrono::milliseconds;
using std::chrono::seconds;

/// Ends a case without a verdict on the server.
struct Apart : std::runtime_error {
  Apart(std::string result_, const std::string& why)
      : std::runtime_error(why), result(std::move(result_)) {}
  std::string result;
};

void require(bool holds, const std::string& fault) {
  if (!holds) throw std::runtime_error(fault);
}
template <class T>
T value_of(expected<T, CallError> result, const std::string& what) {
  if (!result) throw std::runtime_error(what + ": " + rpc::describe(result.error()));
  return std::move(*result);
}
void done(const expected<void, CallError>& result, const std::string& what) {
  if (!result) throw std::runtime_error(what + ": " + rpc::describe(result.error()));
}
template <class T>
T set_up(expected<T, SetupError> result) {
  if (!result) throw std::runtime_error(result.error().text());
  return std::move(*result);
}
template <class Result>
void require_error(const Result& result, std::initializer_list<CallError> wanted,
                   const std::string& what) {
  require(!result, what + " succeeded");
  require(std::ranges::find(wanted, result.error()) != wanted.end(),
          what + ": " + rpc::describe(result.error()));
}
bool await(const std::function<bool()>& holds, Duration patience) {
  const MonotonicTime end = rt::now() + patience;
  while (!holds()) {
    if (rt::now() > end) return false;
    std::this_thread::sleep_for(milliseconds{5});
  }
  return true;
}
std::string random_text() {
  return std::to_string(std::random_device{}());
}

bool are_same(double a, double b) {
  return std::isnan(a) ? std::isnan(b) : a == b && std::signbit(a) == std::signbit(b);
}

class Checks {
 public:
  Checks(rpc::Node& node, const CheckConfig& config)
      : node_(node), config_(config), client_(set_up(bind(config.url))) {}

  /// Runs all cases. Returns whether none failed.
  bool run() {
    const std::pair<const char*, void (Checks::*)()> cases[] = {
        {"numbers", &Checks::numbers},
        {"values", &Checks::values},
        {"range", &Checks::range},
        {"large", &Checks::large},
        {"too_large", &Checks::too_large},
        {"refusals", &Checks::refusals},
        {"no_such_object", &Checks::no_such_object},
        {"wrong_interface", &Checks::wrong_interface},
        {"deadline", &Checks::deadline},
        {"cancel", &Checks::cancel},
        {"expired", &Checks::expired},
        {"at_most_once", &Checks::at_most_once},
        {"concurrent", &Checks::concurrent},
        {"oneways", &Checks::oneways},
        {"priority", &Checks::priority},
        {"stream", &Checks::stream},
        {"slow_reader", &Checks::slow_reader},
        {"stream_cancel", &Checks::stream_cancel},
        {"stream_failure", &Checks::stream_failure},
        {"events", &Checks::events},
        {"name", &Checks::name},
        {"device", &Checks::device},
    };
    bool is_good = true;
    for (const auto& [name, method] : cases)
      is_good = run_one(name, method) && is_good;
    return is_good;
  }

 private:
  bool run_one(const char* name, void (Checks::*method)()) {
    std::string result = "pass";
    std::string detail;
    try {
      (this->*method)();
    } catch (const Apart& apart) {
      result = apart.result;
      detail = apart.what();
    } catch (const std::exception& fault) {
      result = "fail";
      detail = fault.what();
    }
    const nlohmann::ordered_json line{{"case", name}, {"result", result}, {"detail", detail}};
    std::printf("%s\n",
                line.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
    std::fflush(stdout);
    return result != "fail";
  }

  [[nodiscard]] expected<InteropClient, SetupError> bind(const std::string& target) {
    return InteropClient::bind(node_, target,
                               {.transport = config_.transport, .deadline = seconds{5}});
  }
  [[nodiscard]] std::string beside(const std::string& path) const {
    return config_.url.substr(0, config_.url.rfind("interop")) + path;
  }
  std::uint32_t add(std::uint32_t count) {
    CountT request;
    request.count = count;
    return value_of(client_.add(request), "add")->count();
  }

  void echo(const Numbers& sent) {
    const Numbers got = value_of(client_.echo_numbers(sent), "echo_numbers");
    require(got.i8() == sent.i8() && got.u8() == sent.u8() && got.i16() == sent.i16() &&
                got.u16() == sent.u16() && got.i32() == sent.i32() && got.u32() == sent.u32() &&
                got.i64() == sent.i64() && got.u64() == sent.u64(),
            "an integer has changed");
    require(are_same(got.f32(), sent.f32()) && are_same(got.f64(), sent.f64()) &&
                are_same(got.at().x(), sent.at().x()) && are_same(got.at().z(), sent.at().z()),
            "a real number has changed");
    require(got.flag() == sent.flag() && got.color() == sent.color(), "flag or color has changed");
    for (flatbuffers::uoffset_t i = 0; i < 3; ++i)
      require(got.three()->Get(i) == sent.three()->Get(i), "an array has changed");
  }
  template <class T>
  static constexpr auto lowest = std::numeric_limits<T>::lowest();
  template <class T>
  static constexpr auto highest = std::numeric_limits<T>::max();

  void numbers() {
    const std::uint16_t three[3] = {0, 513, 65535};
    const double reals[] = {lowest<double>,
                            highest<double>,
                            0.0,
                            -0.0,
                            std::numbers::pi,
                            5e-324,
                            std::numeric_limits<double>::infinity(),
                            -std::numeric_limits<double>::infinity(),
                            std::numeric_limits<double>::quiet_NaN()};
    for (const double real : reals) {
      const auto single = std::abs(real) == highest<double>
                              ? (real > 0 ? highest<float> : lowest<float>)
                              : static_cast<float>(real);
      echo({lowest<std::int8_t>,
            0,
            lowest<std::int16_t>,
            0,
            lowest<std::int32_t>,
            0,
            lowest<std::int64_t>,
            0,
            single,
            real,
            false,
            Color::Red,
            {real, 0, -real},
            flatbuffers::span<const std::uint16_t, 3>(three)});
      echo({highest<std::int8_t>,
            highest<std::uint8_t>,
            highest<std::int16_t>,
            highest<std::uint16_t>,
            highest<std::int32_t>,
            highest<std::uint32_t>,
            highest<std::int64_t>,
            highest<std::uint64_t>,
            single,
            real,
            true,
            Color::Blue,
            {-real, 1, real},
            flatbuffers::span<const std::uint16_t, 3>(three)});
    }
  }

  [[nodiscard]] static ValuesT full_values() {
    ValuesT full;
    full.text = "naïve 触覚 🖐";
    full.texts = {"", "naïve 触覚 🖐", "last"};
    for (int i = 0; i < 100; ++i)
      full.reals.push_back(i * 0.1);
    full.bytes = {0, 1, 127, 128, 255};
    full.longs = {0, 1, highest<std::uint64_t>};
    full.vectors = {{1, 2, 3}, {-1, -2, -3}};
    auto bare = std::make_unique<LeafT>();
    bare->name = "bare";
    auto weighed = std::make_unique<LeafT>();
    weighed->name = "weighed";
    weighed->weight = 0.5F;
    full.leaves.push_back(std::move(bare));
    full.leaves.push_back(std::move(weighed));
    full.colors = {Color::Blue, Color::Red, Color::Green};
    full.color = Color::Blue;
    full.level = highest<std::int32_t>;
    full.maybe = 0;
    full.newton = -20;
    return full;
  }
  /// Equal for equal values, as both are packed by the same code.
  [[nodiscard]] static std::vector<std::byte> packed(const ValuesT& values) {
    flatbuffers::FlatBufferBuilder builder;
    builder.Finish(Values::Pack(builder, &values));
    const ConstBytes bytes = rpc::table_bytes(builder);
    return {bytes.begin(), bytes.end()};
  }
  void echo(const ValuesT& sent) {
    const auto reply = value_of(client_.echo_values(sent), "echo_values");
    ValuesT got;
    reply->UnPackTo(&got);
    require(packed(got) == packed(sent), "a value has changed");
    require((reply->absent() != nullptr) == !sent.absent.empty(), "an absent text is there");
    require(reply->maybe() == sent.maybe, "maybe has changed");
  }
  void values() {
    ValuesT full = full_values();
    LeafT leaf;
    leaf.name = "leaf";
    full.shape.Set(leaf);
    echo(full);
    full.shape.Set(Vector{1, 2, 3});
    full.maybe = highest<std::uint64_t>;
    echo(full);
    ValuesT bare;
    bare.text = "";
    echo(bare);
    require(bare.color == Color::Green && bare.level == -3 && !bare.maybe, "a default is wrong");
  }
  void range() {
    ValuesT values;
    values.newton = 20;
    echo(values);
    values.newton = 20.5;
    require_error(client_.echo_values(values), {CallError::kBadRequest}, "newton 20.5");
  }

  void echo_bytes(std::size_t size) {
    BytesT sent;
    for (std::size_t i = 0; i < size; ++i)
      sent.bytes.push_back(static_cast<std::uint8_t>(i ^ i >> 8));
    const auto got = value_of(client_.echo_bytes(sent), "echo_bytes of " + std::to_string(size));
    require(std::ranges::equal(*got->bytes(), sent.bytes),
            std::to_string(size) + " bytes have changed");
  }
  void large() {
    for (const std::size_t size : {0U, 1U, 1400U, 1048576U})
      echo_bytes(size);
  }
  void too_large() {
    BytesT sent;
    sent.bytes.resize(1100001);
    require_error(client_.echo_bytes(sent), {CallError::kTooLarge}, "1100001 bytes");
    add(0);
  }

  void refuse(Reason reason, CallError wanted, bool has_text) {
    RefusalT request;
    request.reason = reason;
    request.text = "größer als 5";
    require_error(client_.refuse(request), {wanted}, EnumNameReason(reason));
    require(!has_text || rpc::refusal_text() == request.text,
            std::string(EnumNameReason(reason)) + " has lost its text");
  }
  void refusals() {
    refuse(Reason::bad_request, CallError::kBadRequest, true);
    refuse(Reason::not_lease_holder, CallError::kNotLeaseHolder, false);
    refuse(Reason::gone, CallError::kNoSuchObject, false);
    refuse(Reason::servant_failed, CallError::kServantFailed, true);
  }
  void no_such_object() {
    const auto bound = bind(beside("interop/nothing"));
    require(!bound, "interop/nothing was bound");
    require(bound.error().cause == CallError::kNoSuchObject, bound.error().text());
  }
  void wrong_interface() {
    const auto bound = bind(beside("interop/other"));
    require(!bound, "interop/other was bound");
    require(bound.error().cause == CallError::kWrongInterface, bound.error().text());
  }

  void require_within(MonotonicTime begun, Duration low, Duration high) const {
    const Duration took = rt::now() - begun;
    require(low <= took && took <= high,
            "it took " + std::to_string(took / milliseconds{1}) + " ms");
  }
  void deadline() {
    PauseT pause;
    pause.milliseconds = 500;
    const MonotonicTime begun = rt::now();
    require_error(client_.wait(pause, {.deadline = milliseconds{100}}),
                  {CallError::kTimeout, CallError::kExpired, CallError::kCancelled},
                  "wait of 500 ms");
    require_within(begun, milliseconds{50}, milliseconds{450});
    add(0);
  }
  void cancel() {
    PauseT pause;
    pause.milliseconds = config_.is_lossy ? 300 : 3000;
    auto pending = value_of(client_.begin_wait(pause), "begin_wait");
    require(!pending.wait(rt::now() + milliseconds{50}), "wait did not wait");
    const MonotonicTime begun = rt::now();
    pending.cancel();
    require(pending.wait(rt::now() + milliseconds{500}), "a cancelled call goes on");
    require_error(pending.take(), {CallError::kCancelled}, "a cancelled call");
    require_within(begun, Duration{0}, milliseconds{500});
    // A CANCEL that is lost leaves the call its place.
    if (config_.is_lossy) std::this_thread::sleep_for(milliseconds{300});
    add(0);
  }
  void expired() {
    if (config_.is_lossy) throw Apart("skipped", "add may come before hold");
    const std::uint32_t before = add(0);
    PauseT pause;
    pause.milliseconds = 400;
    auto holding = value_of(client_.begin_hold(pause), "begin_hold");
    std::this_thread::sleep_for(milliseconds{50});
    CountT one;
    one.count = 1;
    require_error(client_.add(one, {.deadline = milliseconds{100}}),
                  {CallError::kTimeout, CallError::kExpired}, "add behind hold");
    require(holding.wait(rt::now() + seconds{5}), "hold does not end");
    if (!value_of(holding.take(), "hold")->was_alone())
      throw Apart("not_offered", "the server runs several calls of a priority at once");
    require(add(0) == before, "an expired call ran");
  }
  void at_most_once() {
    const std::uint32_t before = add(0);
    for (std::uint32_t i = 1; i <= 100; ++i)
      require(add(1) == before + i, "call " + std::to_string(i) + " ran not once");
  }
  void concurrent() {
    std::vector<rpc::PendingTable<Values>> pending;
    const auto text = [](std::size_t i) { return "call " + std::to_string(i); };
    for (std::size_t i = 0; i < 32; ++i) {
      ValuesT request;
      request.text = text(i);
      pending.push_back(value_of(client_.begin_echo_values(request), "begin_echo_values"));
    }
    for (std::size_t i = 0; i < pending.size(); ++i) {
      require(pending[i].wait(rt::now() + seconds{5}), "a call does not end");
      require(value_of(pending[i].take(), "echo_values")->text()->str() == text(i),
              "a call got the reply of another");
    }
  }
  void oneways() {
    const auto count = [this] { return value_of(client_.notes(), "notes")->count(); };
    const std::uint32_t before = count();
    for (std::uint32_t i = 0; i < 10; ++i) {
      NoteT note;
      note.number = i;
      done(client_.note_sent(note), "note_sent");
      done(client_.note_received(note), "note_received");
      done(client_.note_done(note), "note_done");
    }
    const std::uint32_t wanted = config_.is_lossy ? 20 : 30;
    require(await([&] { return count() - before >= wanted; }, seconds{2}),
            "only " + std::to_string(count() - before) + " were noted");
    require(count() - before <= 30, "more were noted than sent");
  }
  void priority() {
    for (const int called : {0, 50}) {
      const auto seen =
          value_of(
              client_.priority({}, {.priority = rtpm::Priority(static_cast<std::int16_t>(called))}),
              "priority")
              ->priority();
      require(seen == called,
              "a call at " + std::to_string(called) + " is seen at " + std::to_string(seen));
    }
  }

  [[nodiscard]] rpc::TableStream<Item> count_up(std::uint32_t count, std::uint32_t padding = 0,
                                                const std::string& failure = {}) {
    RangeT range;
    range.count = count;
    range.padding = padding;
    range.failure = failure;
    return value_of(client_.count_up(range), "count_up");
  }
  static void require_item(rpc::TableStream<Item>& stream, std::uint32_t number,
                           std::uint32_t padding = 0) {
    const Item* const item =
        value_of(stream.next(rt::now() + seconds{5}), "item " + std::to_string(number));
    require(item != nullptr, "the stream ended before item " + std::to_string(number));
    require(item->number() == number,
            "item " + std::to_string(item->number()) + " came as " + std::to_string(number));
    require(padding == 0 || item->padding()->size() == padding, "an item has lost its padding");
  }
  static void require_end(rpc::TableStream<Item>& stream) {
    require(value_of(stream.next(rt::now() + seconds{5}), "the end") == nullptr,
            "the stream does not end");
  }
  void stream() {
    auto stream = count_up(2000);
    for (std::uint32_t i = 0; i < 2000; ++i)
      require_item(stream, i);
    require_end(stream);
  }
  void slow_reader() {
    auto stream = count_up(3000, 1000);
    for (std::uint32_t i = 0; i < 3000; ++i) {
      require_item(stream, i, 1000);
      if (i < 5) std::this_thread::sleep_for(milliseconds{100});
    }
    require_end(stream);
  }
  void stream_cancel() {
    auto stream = count_up(0);
    for (std::uint32_t i = 0; i <= 5; ++i)
      require_item(stream, i);
    stream.cancel();
    const auto is_over = [this] { return value_of(client_.streams(), "streams")->count() == 0; };
    // A cancellation that is lost has no effect but later.
    const bool is_seen = await(is_over, config_.is_lossy ? Duration{0} : seconds{2});
    require(is_seen || config_.is_lossy, "the server goes on");
  }
  void stream_failure() {
    auto stream = count_up(3, 0, "größer als 5");
    for (std::uint32_t i = 0; i < 3; ++i)
      require_item(stream, i);
    require_error(stream.next(rt::now() + seconds{5}), {CallError::kServantFailed}, "the end");
  }

  void events() {
    if (config_.registry.empty()) throw Apart("skipped", "no --registry");
    std::mutex mutex;
    std::vector<std::int32_t> levels;
    const std::string text = random_text();
    events::ConsumerConfig config{.name = "matrix"};
    config.filter =
        events::where(MeasuredEvent::kType, "level", events::Comparison::kGreaterOrEqual,
                      events::Scalar::of(std::int64_t{5}));
    config.types = {&MeasuredEvent::kDescriptor};
    config.realtime = rt::RealtimeMode::kOff;
    config.transport = config_.transport;
    config.deadline = seconds{5};
    const auto consumer = set_up(MeasuredConsumer::create(
        node_, std::string(events::kHubPath),
        [&](const Measured& measured, const events::EventHeader&) {
          const std::lock_guard lock(mutex);
          if (measured.text() != nullptr && measured.text()->str() == text)
            levels.push_back(measured.level());
        },
        config));
    EmissionT emission;
    emission.count = 10;
    emission.text = text;
    done(client_.emit(emission), "emit");
    const std::vector<std::int32_t> wanted{5, 6, 7, 8, 9};
    static_cast<void>(await(
        [&] {
          const std::lock_guard lock(mutex);
          return levels.size() >= wanted.size();
        },
        seconds{5}));
    std::this_thread::sleep_for(milliseconds{20});
    const std::lock_guard lock(mutex);
    require(levels == wanted, std::to_string(levels.size()) + " events came, not 5 to 9");
  }

  void name() {
    if (config_.name.empty()) throw Apart("skipped", "no --name");
    auto named = set_up(bind(config_.name));
    CountT nothing;
    static_cast<void>(value_of(named.add(nothing), "add by name"));
    const std::string own = "matrix/" + random_text();
    auto kept = set_up(names::Registration::create(node_, config_.registry, own, config_.url,
                                                   "rtpm.interop.Interop", seconds{1}));
    std::this_thread::sleep_for(milliseconds{2500});
    require(set_up(names::url_of(node_, config_.registry, own)) == config_.url,
            "the name leads elsewhere");
    kept.reset();
    require(!names::url_of(node_, config_.registry, own), "an unbound name is found");
  }

  void device() {
    if (config_.device.empty()) throw Apart("skipped", "no --device");
    const auto succeeded = [](const gvd::DeviceResult& result, const std::string& what) {
      if (!result) throw std::runtime_error(what + ": " + std::string(to_string(result.error())));
    };
    const gvd::DeviceClientOptions options{.bind = {.transport = config_.transport},
                                           .hold = milliseconds{100}};
    rpc::Node other_node(node_.config());
    names::RegistryResolver resolver(other_node, config_.registry);
    other_node.use(resolver);
    auto own = set_up(gvd::DeviceClient::open(node_, config_.device, options));
    auto other = set_up(gvd::DeviceClient::open(other_node, config_.device, options));
    succeeded(own.acquire(), "acquire");
    const auto second = other.acquire(Duration{0});
    require(!second && second.error() == gvd::DeviceOutcome::kHeld, "two hold the lease");
    succeeded(own.set_force({0, 0, 1}), "set_force");
    require(await(
                [&] {
                  const auto sample = own.read();
                  return sample && sample->wrench_applied.force_newton.z != 0;
                },
                milliseconds{100}),
            "no sample shows the force");
    succeeded(own.release(), "release");
    succeeded(other.acquire(), "acquire by the other");
    succeeded(other.release(), "release by the other");
  }

  rpc::Node& node_;
  const CheckConfig& config_;
  InteropClient client_;
};

}  // namespace

bool check(rpc::Node& node, const CheckConfig& config) {
  try {
    return Checks(node, config).run();
  } catch (const std::exception& fault) {
    std::fprintf(stderr, "interop: %s\n", fault.what());
    return false;
  }
}

}  // namespace rtpm::interop
