#include "servants.hpp"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "errors.hpp"
#include "forking.hpp"
#include "hand_over.hpp"
#include "node.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/names/registration.hpp"
#include "rtpm/rpc/refusal.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/clock.hpp"
#include "schema.hpp"
#include "waiting.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace rtpm::python {
namespace {

wire::Status status_of(const std::string& name) {
  if (name == "Overload") return wire::Status::kOverload;
  if (name == "BadRequest") return wire::Status::kBadRequest;
  if (name == "NotLeaseHolder") return wire::Status::kNotLeaseHolder;
  if (name == "NoSuchObject") return wire::Status::kGone;
  if (name == "NotAllowed") return wire::Status::kNotAllowed;
  return wire::Status::kServantFailed;
}

/// A call that a worker answers.
/// @ownership keeps its schema
class Job {
 public:
  Job(Call call, nb::object schema_object, const schema::Service& service)
      : call_(std::move(call)),
        schema_object_(std::move(schema_object)),
        schema_(nb::cast<const Schema&>(schema_object_)),
        method_(service.methods[call_.method]) {}

  std::size_t object() const noexcept { return call_.object; }
  std::size_t method() const noexcept { return call_.method; }
  std::uint16_t priority() const noexcept { return call_.priority.value(); }
  std::uint64_t trace_id() const noexcept { return call_.trace_id; }
  bool is_stream() const noexcept { return method_.is_stream; }
  /// Whether the caller still waits.
  bool is_awaited() const noexcept {
    return call_.items ? call_.items.is_awaited()
                       : call_.reply.is_awaited() && rt::now() < call_.deadline;
  }
  std::optional<double> seconds_left() const { return seconds_until(call_.deadline); }
  std::uint64_t session() const noexcept { return call_.session; }
  std::string caller_host() const { return rpc::to_string(call_.caller); }
  const std::string& caller_name() const noexcept { return call_.caller_name; }
  /// For the calls that its method makes.
  CallScope scope() const noexcept {
    return {.priority = call_.priority, .deadline = call_.deadline, .trace_id = call_.trace_id};
  }

  /// The argument; None after a refusal, because the bytes are not a request of the method.
  nb::object request() {
    if (call_.request.size() > size_max()) {
      end(wire::Status::kTooLarge);
      return nb::none();
    }
    const std::string reason = schema_.codec().refusal(method_.request, call_.request);
    if (!reason.empty()) {
      refuse("BadRequest", reason);
      return nb::none();
    }
    return schema_.codec().decode(method_.request, call_.request);
  }
  bool is_answered() const noexcept { return !call_.reply && !call_.items; }

  void complete(nb::handle value) {
    const auto bytes = schema_.codec().encode(method_.reply, value);
    if (!call_.reply) return;
    const MutableBytes buffer = call_.reply.buffer();
    if (bytes.size() > std::min<std::size_t>(buffer.size(), size_max())) {
      call_.reply.complete(wire::Status::kTooLarge);
      return;
    }
    std::memcpy(buffer.data(), bytes.data(), bytes.size());
    call_.reply.complete(wire::Status::kOk, static_cast<std::uint32_t>(bytes.size()));
  }

  void refuse(const std::string& kind, const std::string& text) {
    const wire::Status status = status_of(kind);
    if (call_.items) {
      call_.items.finish(status);
    } else if (call_.reply) {
      const auto result = rpc::refuse(status, text, call_.reply.buffer());
      call_.reply.complete(result.status, result.reply_size);
    }
  }

  /// Ends a call whose caller no longer waits.
  void expire() { end(wire::Status::kExpired); }

  /// Writes an item as soon as the caller takes more; false if it takes no more.
  bool write(nb::handle value) {
    const auto bytes = schema_.codec().encode(method_.reply, value);
    expected<void, rpc::StreamError> written{unexpected{rpc::StreamError::kEnded}};
    wait_in_slices([&] {
      // A queue that is full has no wake-up for its writer.
      constexpr Duration kPause = std::chrono::milliseconds{1};
      const MonotonicTime end = rt::now() + kSlice;
      while (true) {
        written = call_.items.write(bytes, size_max());
        if (written || written.error() != rpc::StreamError::kFull) return true;
        if (rt::now() >= end) return false;
        rt::sleep_until(rt::now() + kPause);
      }
    });
    if (!written && written.error() == rpc::StreamError::kTooLarge) {
      raise_value_error("the item is larger than its caller or the schema allows");
    }
    return written.has_value();
  }
  void finish() {
    if (call_.items) call_.items.finish();
  }

 private:
  /// The limit of a request, a reply or an item, in bytes.
  std::uint32_t size_max() const noexcept {
    return method_.max_size.value_or(std::numeric_limits<std::uint32_t>::max());
  }
  void end(wire::Status status) noexcept {
    if (call_.reply) call_.reply.complete(status);
    if (call_.items) call_.items.finish(status);
  }

  Call call_;
  nb::object schema_object_;
  const Schema& schema_;
  const schema::Method& method_;
};

/// Serves objects of Python.
/// @ownership keeps its node and schemas
class Server {
 public:
  Server(SharedNode node, std::string host, std::uint16_t port, std::uint32_t queue)
      : node_(std::move(node)) {
    rpc::ServerConfig config;
    config.name = "python";
    config.host = std::move(host);
    config.port = port;
    // Workers of Python are time-shared, so nothing is gained by a lane that is not.
    config.lanes = {{.schedule = rt::Schedule::kTimeShared}};
    config.deferred_call_count_max = queue;
    config.security = node_->node.config().served;
    server_ = unforked(value_of(rpc::Server::create(std::move(config))));
  }

  void add(const std::string& path, nb::object schema, std::size_t service) {
    const auto& kept = nb::cast<const Schema&>(schema);
    objects_.push_back(
        {schema, &kept.service(service),
         std::make_unique<HandedOver>(workers_, objects_.size(), kept.interface(service),
                                      kept.service(service)),
         path});
    catalog_.add(path, *objects_.back().servant);
    value_of(server_->add(path, *objects_.back().servant));
  }

  void start(bool is_named) {
    value_of(catalog_.serve(*server_));
    value_of(server_->start());
    if (!is_named) return;
    for (const Object& object : objects_) {
      using Bound = expected<std::shared_ptr<names::Registration>, SetupError>;
      auto bound = interruptible<Bound>(
          [node = node_, path = object.path, url = server_->url(object.path),
           interface = std::string(object.servant->interface().name)]() -> Bound {
            auto made = names::Registration::create(node->node, node->where, path, url, interface);
            if (!made) return unexpected{std::move(made.error())};
            return std::shared_ptr<names::Registration>(unforked(std::move(*made)));
          });
      names_.push_back(value_of(std::move(bound)));
    }
  }

  /// A call, or None if none comes within a slice.
  std::optional<Job> take() {
    auto call = [&] {
      const Released released;
      return workers_->take(kSlice);
    }();
    if (!call) return std::nullopt;
    const Object& object = objects_[call->object];
    return std::optional<Job>(std::in_place, std::move(*call), object.schema, *object.service);
  }

  void stop() {
    const Released released;
    names_.clear();
    server_->stop();
  }

  std::string url(const std::string& path) const { return server_->url(path); }

 private:
  struct Object {
    nb::object schema;
    const schema::Service* service;
    std::unique_ptr<HandedOver> servant;
    std::string path;
  };

  SharedNode node_;
  std::shared_ptr<HandOver> workers_ = std::make_shared<HandOver>();
  std::vector<Object> objects_{};
  introspection::Catalog catalog_{};
  Unforked<rpc::Server> server_{};
  std::vector<std::shared_ptr<names::Registration>> names_{};
};

}  // namespace

void define_servants(nb::module_& module) {
  nb::class_<Job>(module, "Job")
      .def_prop_ro("servant", &Job::object)
      .def_prop_ro("method", &Job::method)
      .def_prop_ro("priority", &Job::priority)
      .def_prop_ro("trace_id", &Job::trace_id)
      .def_prop_ro("is_stream", &Job::is_stream)
      .def_prop_ro("is_awaited", &Job::is_awaited)
      .def_prop_ro("is_answered", &Job::is_answered)
      .def_prop_ro("seconds_left", &Job::seconds_left)
      .def_prop_ro("session", &Job::session)
      .def_prop_ro("caller_host", &Job::caller_host)
      .def_prop_ro("caller_name", &Job::caller_name)
      .def_prop_ro("scope", &Job::scope)
      .def("request", &Job::request)
      .def("complete", &Job::complete, "value"_a.none())
      .def("refuse", &Job::refuse, "kind"_a, "text"_a)
      .def("expire", &Job::expire)
      .def("write", &Job::write, "value"_a)
      .def("finish", &Job::finish);
  nb::class_<Server>(module, "Server")
      .def(nb::init<SharedNode, std::string, std::uint16_t, std::uint32_t>(), "node"_a, "host"_a,
           "port"_a, "queue"_a)
      .def("add", &Server::add, "path"_a, "schema"_a, "service"_a)
      .def("start", &Server::start, "is_named"_a)
      .def("take", &Server::take)
      .def("stop", &Server::stop)
      .def("url", &Server::url, "path"_a);
}

}  // namespace rtpm::python
