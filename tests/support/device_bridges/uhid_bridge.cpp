#include "uhid_bridge.hpp"

#include <fcntl.h>
#include <linux/uhid.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <optional>

#include "rtpm/rt/clock.hpp"

namespace rtpm::device_bridges {
namespace {

constexpr const char* kNode = "/dev/uhid";

// The kernel's structures are packed, so that no reference to their fields may be made.
void copy_text(const std::string& text, void* into, std::size_t size) {
  std::memcpy(into, text.data(), std::min(text.size(), size - 1));
}

/// Returns the number of bytes copied, at most UHID_DATA_MAX.
__u16 copy_report(std::span<const std::byte> bytes, void* into) {
  const std::size_t size = std::min<std::size_t>(bytes.size(), UHID_DATA_MAX);
  if (size > 0) std::memcpy(into, bytes.data(), size);
  return static_cast<__u16>(size);
}

std::span<const std::byte> report_of(const void* data, __u16 size) {
  return {static_cast<const std::byte*>(data), std::min<std::size_t>(size, UHID_DATA_MAX)};
}

bool send(int handle, const uhid_event& event) {
  return ::write(handle, &event, sizeof event) == static_cast<ssize_t>(sizeof event);
}

uhid_event creation_of(const HidModel& model) {
  uhid_event event{};
  event.type = UHID_CREATE2;
  uhid_create2_req& request = event.u.create2;
  copy_text(model.identity.name, &request.name, sizeof request.name);
  copy_text(model.identity.serial_number, &request.uniq, sizeof request.uniq);
  request.bus = model.identity.bus;
  request.vendor = model.identity.vendor;
  request.product = model.identity.product;
  request.version = model.identity.version;
  request.rd_size = copy_report(model.report_descriptor, &request.rd_data);
  return event;
}

}  // namespace

expected<void, SetupError> UhidBridge::plug() {
  unplug();
  const std::string what = model_.identity.name + " cannot be plugged in by " + kNode;
  handle_ = ::open(kNode, O_RDWR | O_CLOEXEC | O_NONBLOCK);
  if (handle_ < 0) {
    return setup_error(what, system_error(errno), "load the kernel module uhid; run as root");
  }
  if (!send(handle_, creation_of(model_))) {
    const int error = errno;
    ::close(std::exchange(handle_, -1));
    return setup_error(what, system_error(error), "check the model's report descriptor");
  }
  is_stopping_ = false;
  thread_ = std::thread([this] { serve(); });
  return {};
}

void UhidBridge::unplug() noexcept {
  if (handle_ < 0) return;
  // While the kernel ends the device it may still wait for answers, which the thread sends.
  uhid_event event{};
  event.type = UHID_DESTROY;
  static_cast<void>(send(handle_, event));
  is_stopping_ = true;
  thread_.join();
  ::close(std::exchange(handle_, -1));
}

void UhidBridge::serve() {
  MonotonicTime due = rt::now();
  while (!is_stopping_) {
    pollfd entry{.fd = handle_, .events = POLLIN, .revents = 0};
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(due - rt::now());
    if (::poll(&entry, 1, static_cast<int>(std::max<std::int64_t>(0, left.count()))) > 0) {
      take_event();
    }
    if (rt::now() < due) continue;
    send_input_report();
    due = std::max(due + period_, rt::now());
  }
}

void UhidBridge::send_input_report() {
  if (!model_.next_input_report) return;
  const std::vector<std::byte> report =
      with_model([this] { return model_.next_input_report(rt::now()); });
  if (report.empty()) return;
  uhid_event event{};
  event.type = UHID_INPUT2;
  event.u.input2.size = copy_report(report, &event.u.input2.data);
  static_cast<void>(send(handle_, event));
}

void UhidBridge::take_event() {
  uhid_event event{};
  if (::read(handle_, &event, sizeof event) <= 0) return;
  uhid_event reply{};
  if (event.type == UHID_OUTPUT) {
    const auto bytes = report_of(&event.u.output.data, event.u.output.size);
    if (!model_.on_output_report) return;
    with_model([&] { model_.on_output_report(bytes); });
  } else if (event.type == UHID_GET_REPORT) {
    const uhid_get_report_req& request = event.u.get_report;
    std::vector<std::byte> report;
    if (model_.on_get_feature_report && request.rtype == UHID_FEATURE_REPORT) {
      report = with_model([&] { return model_.on_get_feature_report(request.rnum); });
    }
    reply.type = UHID_GET_REPORT_REPLY;
    reply.u.get_report_reply.id = request.id;
    reply.u.get_report_reply.err = report.empty() ? EIO : 0;
    reply.u.get_report_reply.size = copy_report(report, &reply.u.get_report_reply.data);
    static_cast<void>(send(handle_, reply));
  } else if (event.type == UHID_SET_REPORT) {
    const uhid_set_report_req& request = event.u.set_report;
    const auto bytes = report_of(&request.data, request.size);
    bool is_taken = false;
    if (request.rtype == UHID_OUTPUT_REPORT && model_.on_output_report) {
      with_model([&] { model_.on_output_report(bytes); });
      is_taken = true;
    } else if (request.rtype == UHID_FEATURE_REPORT && model_.on_set_feature_report) {
      is_taken = with_model([&] { return model_.on_set_feature_report(bytes); });
    }
    reply.type = UHID_SET_REPORT_REPLY;
    reply.u.set_report_reply.id = request.id;
    reply.u.set_report_reply.err = is_taken ? 0 : EIO;
    static_cast<void>(send(handle_, reply));
  }
}

}  // namespace rtpm::device_bridges
