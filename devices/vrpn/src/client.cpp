#include "rtpm/device_vrpn/client.hpp"

#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <memory>
#include <optional>
#include <utility>

#include "rtpm/driver/arguments.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/vrpn/payload.hpp"

namespace rtpm::device_vrpn {
namespace {

constexpr std::size_t kNameCountMax = 4096;

unexpected<SetupError> refusal(std::string what) {
  return setup_error(std::move(what), "",
                     "give words of 'host=ADDRESS port=3883 tracker=Tracker0 sensor=0'");
}

/// Waits until the socket is ready for `events`; false at the end of `patience`.
bool wait_for(int socket, short events, Duration patience) {
  pollfd waiting{.fd = socket, .events = events, .revents = 0};
  const auto wait = std::chrono::ceil<std::chrono::milliseconds>(std::max(patience, Duration{0}));
  return ::poll(&waiting, 1, static_cast<int>(wait.count())) > 0;
}

/// A socket that is connected within `patience`; an errno otherwise.
expected<int, int> connected(const addrinfo& address, Duration patience) {
  const int socket =
      ::socket(address.ai_family, address.ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (socket < 0) return unexpected{errno};
  int problem = ::connect(socket, address.ai_addr, address.ai_addrlen) == 0 ? 0 : errno;
  if (problem == EINPROGRESS) {
    problem = ETIMEDOUT;
    socklen_t size = sizeof problem;
    if (wait_for(socket, POLLOUT, patience)) {
      ::getsockopt(socket, SOL_SOCKET, SO_ERROR, &problem, &size);
    }
  }
  if (problem == 0) return socket;
  ::close(socket);
  return unexpected{problem};
}

/// The pose with a unit quaternion; nullopt if that is impossible.
std::optional<driver::Pose> normalised(driver::Pose pose) {
  driver::Quaternion& q = pose.orientation;
  const double size = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  if (!(size > 0.5 && size < 2)) return std::nullopt;
  for (double* const part : {&q.x, &q.y, &q.z, &q.w})
    *part /= size;
  return pose;
}

}  // namespace

expected<Settings, SetupError> read_settings(std::string_view words) {
  const auto read =
      driver::read_words("vrpn", words, {.names = {"host", "port", "tracker", "sensor"}});
  if (!read) return refusal(read.error().what);
  Settings settings;
  const auto take = [&read](const char* name, std::string& to) {
    if (std::string value = driver::value_of(*read, name); !value.empty()) to = std::move(value);
  };
  std::string port = std::to_string(settings.port);
  std::string sensor = "0";
  take("host", settings.host);
  take("port", port);
  take("tracker", settings.tracker);
  take("sensor", sensor);
  const auto port_number = driver::to_number<std::uint16_t>(port);
  const auto sensor_number = driver::to_number<std::uint16_t>(sensor);
  if (!port_number || *port_number == 0) return refusal("the driver vrpn was told port=" + port);
  if (!sensor_number) return refusal("the driver vrpn was told sensor=" + sensor);
  settings.port = *port_number;
  settings.sensor = *sensor_number;
  return settings;
}

expected<void, SetupError> Client::open(Duration patience) {
  close();
  const std::string what = "VRPN server " + settings_.host + ":" + std::to_string(settings_.port);
  addrinfo wanted{};
  wanted.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (::getaddrinfo(settings_.host.c_str(), std::to_string(settings_.port).c_str(), &wanted,
                    &found) != 0) {
    return setup_error(what + " has no address", "", "check host= of the driver's arguments");
  }
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owned(found, &::freeaddrinfo);
  const auto socket = connected(*found, patience);
  if (!socket) {
    return setup_error(what + " was not reached", system_error(socket.error()),
                       "start it, or check host= and port= of the driver's arguments");
  }
  socket_ = *socket;
  const auto greeting = vrpn::cookie();
  static_cast<void>(::send(socket_, greeting.data(), greeting.size(), MSG_NOSIGNAL));
  const MonotonicTime end = rt::now() + patience;
  while (!is_greeted_ && rt::now() < end) {
    if (step(end - rt::now())) continue;
    close();
    return setup_error(what + " ended the connection, or is no VRPN server of version 07");
  }
  if (is_greeted_) return {};
  close();
  return setup_error(what + " sent no cookie", "", "check that VRPN listens at this port");
}

bool Client::step(Duration patience) {
  if (!wait_for(socket_, POLLIN, patience)) return true;
  std::array<std::byte, 4096> buffer{};
  const ssize_t count = ::recv(socket_, buffer.data(), buffer.size(), 0);
  if (count <= 0) return count < 0 && (errno == EAGAIN || errno == EINTR);
  ConstBytes bytes = ConstBytes(buffer).first(static_cast<std::size_t>(count));
  if (!is_greeted_) {
    const std::size_t taken = std::min(bytes.size(), vrpn::kCookieSize - cookie_.size());
    cookie_.insert(cookie_.end(), bytes.begin(),
                   bytes.begin() + static_cast<std::ptrdiff_t>(taken));
    bytes = bytes.subspan(taken);
    if (cookie_.size() < vrpn::kCookieSize) return true;
    if (!vrpn::is_cookie(cookie_)) return false;
    is_greeted_ = true;
  }
  parser_.push(bytes);
  while (const auto message = parser_.next())
    take(*message);
  return !parser_.is_broken();
}

void Client::take(const vrpn::Message& message) {
  if (message.type == vrpn::kSenderDescription || message.type == vrpn::kTypeDescription) {
    auto& names = message.type == vrpn::kSenderDescription ? senders_ : types_;
    if (const auto name = vrpn::read_name(message.payload); name && names.size() < kNameCountMax) {
      names[message.sender] = *name;
    }
    return;
  }
  const auto type = types_.find(message.type);
  const auto sender = senders_.find(message.sender);
  if (type == types_.end() || type->second != vrpn::kPoseType) return;
  if (sender == senders_.end() || sender->second != settings_.tracker) return;
  const auto report = vrpn::read_pose(message.payload);
  if (report && report->sensor != settings_.sensor) return;
  const auto pose = report ? normalised(report->pose) : std::nullopt;
  if (!pose) {
    ++reading_.corrupt_count;
    return;
  }
  reading_.pose = *pose;
  reading_.time = rt::now();
  ++reading_.count;
}

void Client::close() noexcept {
  if (socket_ >= 0) ::close(socket_);
  socket_ = -1;
  is_greeted_ = false;
  cookie_.clear();
  parser_ = {};
  senders_.clear();
  types_.clear();
}

}  // namespace rtpm::device_vrpn
