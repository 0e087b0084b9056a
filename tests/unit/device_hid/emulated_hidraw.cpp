#include "emulated_hidraw.hpp"

#include <fcntl.h>
#include <linux/hidraw.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "rtpm/base/assert.hpp"
#include "umockdev.hpp"

namespace rtpm::test {

struct EmulatedHidraw::Testbed {
  UMockdevTestbed* bed = umockdev_testbed_new();
  Testbed() = default;
  Testbed(const Testbed&) = delete;
  Testbed& operator=(const Testbed&) = delete;
  ~Testbed() { g_object_unref(bed); }
};

struct EmulatedHidraw::Node {
  std::mutex* mutex = nullptr;
  std::shared_ptr<HidModel> model{};
  int number = 0;
  std::string device{};  ///< A path below /sys.
  UMockdevIoctlBase* handler = umockdev_ioctl_base_new();
  int master = -1;
  int slave = -1;  ///< Kept open to see how much is unread.
  std::atomic<int> read_count{0};

  Node() = default;
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;
  ~Node() {
    if (slave >= 0) ::close(slave);
    g_object_unref(handler);
  }
  [[nodiscard]] std::string path() const { return "/dev/hidraw" + std::to_string(number); }
};

namespace {

using Node = EmulatedHidraw::Node;

gboolean on_ioctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer context) {
  auto& node = *static_cast<Node*>(context);
  const std::lock_guard lock(*node.mutex);
  const unsigned long request = umockdev_ioctl_client_get_request(client);
  if (_IOC_TYPE(request) != 'H') return FALSE;
  const std::size_t size = _IOC_SIZE(request);
  const IoctlMemory memory(client, size);
  if (_IOC_NR(request) == _IOC_NR(HIDIOCGRDESCSIZE)) {
    HidReport answer(sizeof(int));
    put_le(answer, 0, node.model->report_descriptor().size(), answer.size());
    memory.put(answer);
    umockdev_ioctl_client_complete(client, 0, 0);
  } else if (_IOC_NR(request) == _IOC_NR(HIDIOCGFEATURE(0))) {
    HidReport answer = node.model->read_feature(memory.data()[0]);
    answer.resize(std::min(answer.size(), size));
    memory.put(answer);
    const bool has_answer = !answer.empty();
    umockdev_ioctl_client_complete(client, has_answer ? static_cast<glong>(answer.size()) : -1,
                                   has_answer ? 0 : EPIPE);
  } else {
    umockdev_ioctl_client_complete(client, -1, EINVAL);
  }
  return TRUE;
}

gboolean on_write(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer context) {
  auto& node = *static_cast<Node*>(context);
  const std::lock_guard lock(*node.mutex);
  const UMockdevIoctlData* const data = umockdev_ioctl_client_get_arg(client);
  const HidReport report(data->data, data->data + data->data_len);
  const bool is_taken = node.model->write(report);
  umockdev_ioctl_client_complete(client, is_taken ? data->data_len : -1, is_taken ? 0 : EPIPE);
  return TRUE;
}

template <class... Values>
std::string text(const char* format, Values... values) {
  std::array<char, 64> buffer{};
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-vararg)
  std::snprintf(buffer.data(), buffer.size(), format, values...);
  return buffer.data();
}

/// udev's description of the HID device and its node.
std::string description(const Node& node, const std::string& serial, const std::string& port) {
  const HidIdentity identity = node.model->identity();
  const int bus = identity.is_bluetooth ? 5 : 3;
  std::string descriptor;
  for (const std::uint8_t byte : node.model->report_descriptor())
    descriptor += text("%02X", byte);
  return "P: " + node.device + "\nE: SUBSYSTEM=hid\nE: HID_ID=" +
         text("%04X:%08X:%08X", bus, identity.vendor, identity.product) +
         "\nE: HID_NAME=" + identity.name + "\nE: HID_PHYS=" + port + "\nE: HID_UNIQ=" + serial +
         "\nH: report_descriptor=" + descriptor + "\n\nP: " + node.device + "/hidraw/hidraw" +
         std::to_string(node.number) + "\nN: hidraw" + std::to_string(node.number) +
         "\nL: device=../../../" + node.device.substr(node.device.rfind('/') + 1) +
         "\nE: SUBSYSTEM=hidraw\nE: DEVNAME=" + node.path() + "\n\n";
}

bool has_unread(const Node& node) {
  pollfd ready{.fd = node.slave, .events = POLLIN, .revents = 0};
  return ::poll(&ready, 1, 0) == 1 && (ready.revents & POLLIN) != 0;
}

/// Writes the report and waits until it is read, so that no two reports merge. If nothing reads,
/// the report is lost, as on hidraw.
void hand_over(const Node& node, const HidReport& report) {
  const int read_count = node.read_count;
  if (::write(node.master, report.data(), report.size()) < 0) return;
  for (int i = 0; i < 1000; ++i) {
    if (node.read_count != read_count && !has_unread(node)) return;
    std::this_thread::sleep_for(std::chrono::microseconds{100});
  }
  std::array<char, 256> lost{};
  while (has_unread(node) && ::read(node.slave, lost.data(), lost.size()) > 0) {
  }
}

/// The reader reads the node itself; this function only counts the read.
gboolean on_read(UMockdevIoctlBase*, UMockdevIoctlClient*, gpointer context) {
  ++static_cast<Node*>(context)->read_count;
  return FALSE;
}

}  // namespace

EmulatedHidraw::EmulatedHidraw() : testbed_(std::make_unique<Testbed>()) {
  thread_ = std::thread([this] { run(); });
}

EmulatedHidraw::~EmulatedHidraw() {
  is_stopping_ = true;
  thread_.join();
  testbed_.reset();
}

HidModel& EmulatedHidraw::model_of(int number) {
  const auto found = std::ranges::find(nodes_, number, [](auto& node) { return node->number; });
  RTPM_ASSERT(found != nodes_.end(), "there is such a node");
  return *(*found)->model;
}

void EmulatedHidraw::plug(std::shared_ptr<HidModel> model, int number, const std::string& serial,
                          const std::string& port) {
  auto node = std::make_unique<Node>();
  node->mutex = &mutex_;
  node->model = std::move(model);
  node->number = number;
  const HidIdentity identity = node->model->identity();
  node->device = "/devices/virtual/misc/uhid/" +
                 text("0003:%04X:%04X.%04X", identity.vendor, identity.product, number + 1);
  GError* error = nullptr;
  umockdev_testbed_add_from_string(testbed_->bed, description(*node, serial, port).c_str(), &error);
  RTPM_ASSERT(error == nullptr, "umockdev takes the description");
  g_signal_connect(node->handler, "handle-ioctl", G_CALLBACK(on_ioctl), node.get());
  g_signal_connect(node->handler, "handle-read", G_CALLBACK(on_read), node.get());
  g_signal_connect(node->handler, "handle-write", G_CALLBACK(on_write), node.get());
  umockdev_testbed_attach_ioctl(testbed_->bed, node->path().c_str(), node->handler, &error);
  RTPM_ASSERT(error == nullptr, "umockdev takes the handler");
  node->master = umockdev_testbed_get_dev_fd(testbed_->bed, node->path().c_str());
  std::array<char, 64> name{};
  RTPM_ASSERT(::ptsname_r(node->master, name.data(), name.size()) == 0, "a node is a terminal");
  node->slave = ::open(name.data(), O_RDWR | O_NOCTTY);
  RTPM_ASSERT(node->slave >= 0, "the node's other end opens");
  const std::lock_guard lock(nodes_mutex_);
  nodes_.push_back(std::move(node));
}

void EmulatedHidraw::unplug(int number) {
  const std::lock_guard lock(nodes_mutex_);
  const auto found = std::ranges::find(nodes_, number, [](auto& each) { return each->number; });
  RTPM_ASSERT(found != nodes_.end(), "there is such a node");
  const std::string device = "/sys" + (*found)->device;
  umockdev_testbed_remove_device(testbed_->bed,
                                 (device + "/hidraw/hidraw" + std::to_string(number)).c_str());
  umockdev_testbed_remove_device(testbed_->bed, device.c_str());
  // Programs that opened it may still call it.
  unplugged_.push_back(std::move(*found));
  nodes_.erase(found);
}

/// Hands reports over without the models' lock: the umockdev thread that serves a node's reads also
/// passes written reports to the models.
void EmulatedHidraw::run() {
  constexpr std::chrono::milliseconds kTick{4};
  while (!is_stopping_) {
    std::this_thread::sleep_for(kTick);
    const std::lock_guard nodes_lock(nodes_mutex_);
    for (const auto& node : nodes_) {
      std::vector<HidReport> reports;
      {
        const std::lock_guard lock(mutex_);
        node->model->advance(kTick);
        for (HidReport report; node->model->take_input(report);)
          reports.push_back(report);
      }
      for (const HidReport& report : reports)
        hand_over(*node, report);
    }
  }
}

}  // namespace rtpm::test
