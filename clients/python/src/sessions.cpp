#include "sessions.hpp"

#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "errors.hpp"
#include "node.hpp"
#include "rtpm/capture/live_recording.hpp"
#include "rtpm/capture/session.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/utc.hpp"
#include "waiting.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace rtpm::python {
namespace {

/// A running recording of a session.
/// @threads any
struct LiveRecording {
  SharedNode node;
  std::string path;
  std::mutex mutex{};
  std::unique_ptr<capture::LiveRecording> recording{};  ///< Null after stop().
};
using SharedRecording = std::shared_ptr<LiveRecording>;

SharedRecording start(const SharedNode& node, const std::string& pattern, std::string participant,
                      std::string experiment, std::string condition, std::string notes,
                      std::string hub, std::vector<std::string> devices,
                      std::vector<std::string> topics) {
  capture::Session session{std::move(participant), std::move(experiment), std::move(condition),
                           std::move(notes)};
  value_of(capture::check(session));
  const std::string path =
      capture::free_path(value_of(capture::session_file(pattern, session, rt::utc_ns(rt::now()))));
  capture::LiveRecordingConfig config{.hub = std::move(hub),
                                      .registry = node->where,
                                      .session = std::move(session),
                                      .devices = std::move(devices),
                                      .topics = std::move(topics)};
  config.recorder.writer.profile = "rtpm";
  using Started = expected<SharedRecording, SetupError>;
  return value_of(interruptible<Started>([node, path, config]() -> Started {
    auto started = capture::LiveRecording::start(node->node, path, config);
    if (!started) return unexpected{started.error()};
    auto self = std::make_shared<LiveRecording>();
    self->node = node;
    self->path = path;
    self->recording = std::move(*started);
    return self;
  }));
}

/// Messages, drops and bytes so far, and sentences about what is missing.
nb::tuple status(const SharedRecording& self) {
  capture::LiveRecordingStatus status;
  {
    const Released released;
    const std::lock_guard lock(self->mutex);
    if (self->recording) status = self->recording->status();
  }
  return nb::make_tuple(status.recorder.message_count,
                        status.recorder.drop_count + status.lost_count, status.recorder.byte_count,
                        status.reports);
}

void annotate(const SharedRecording& self, const std::string& text) {
  const Released released;
  const std::lock_guard lock(self->mutex);
  if (self->recording) static_cast<void>(self->recording->annotate(text));
}

/// Ends the recording; returns its last status.
nb::tuple stop(const SharedRecording& self) {
  using Stopped = expected<capture::LiveRecordingStatus, SetupError>;
  const auto stopped = value_of(interruptible<Stopped>([self]() -> Stopped {
    const std::lock_guard lock(self->mutex);
    if (!self->recording) return capture::LiveRecordingStatus{};
    const auto closed = self->recording->stop();
    auto last = self->recording->status();
    self->recording.reset();
    if (!closed) return unexpected{closed.error()};
    return last;
  }));
  return nb::make_tuple(stopped.recorder.message_count,
                        stopped.recorder.drop_count + stopped.lost_count,
                        stopped.recorder.byte_count, stopped.reports);
}

}  // namespace

void define_sessions(nb::module_& module) {
  nb::class_<LiveRecording>(module, "LiveRecording")
      .def(nb::new_(&start), "node"_a, "pattern"_a, "participant"_a, "experiment"_a, "condition"_a,
           "notes"_a, "hub"_a, "devices"_a, "topics"_a)
      .def_prop_ro("path", [](const LiveRecording& self) { return self.path; })
      .def("status", &status)
      .def("annotate", &annotate, "text"_a)
      .def("stop", &stop);
}

}  // namespace rtpm::python
