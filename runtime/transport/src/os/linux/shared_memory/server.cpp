#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "shared_memory/memory.hpp"
#include "shared_memory/setup.hpp"
#include "shared_memory/unix_socket.hpp"
#include "sockets/native.hpp"

namespace rtpm::transport {
namespace {

// Removes the file of a killed server, where connects are refused.
void remove_if_dead(const std::string& file, const sockaddr_un& native, unsigned size) noexcept {
  const Descriptor probe(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (connect(probe.number(), reinterpret_cast<const sockaddr*>(&native), size) != 0 &&
      errno == ECONNREFUSED) {
    unlink(file.c_str());
  }
}

SetupError not_served(const SharedMemoryAddress& address, const std::string& cause,
                      const std::string& remedy) {
  return {in_words(address) + " can't be served", cause, remedy};
}

bool is_admitted(int socket, const UserPolicy* policy) noexcept {
  if (policy == nullptr) return is_trusted(socket);
  const auto user = user_of(socket);
  return user && policy->admits(*user);
}

void refuse(int socket, SetupStatus status) {
  const auto answer = encode(SetupAnswer{.status = status});
  static_cast<void>(send_message(socket, answer, {}));
}

}  // namespace

bool offers_shared_memory() noexcept {
  return true;
}

expected<SharedMemoryListener, SetupError> SharedMemoryListener::open(
    const SharedMemoryAddress& address) {
  sockaddr_un native{};
  const unsigned size = to_native(address, native);
  if (size == 0) {
    return unexpected{
        not_served(address, "its name is longer than 107 bytes", "choose a shorter folder.")};
  }
  Descriptor socket(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!socket.is_open()) {
    return unexpected{not_served(address, std::strerror(errno), remedy_for_shortage(errno))};
  }
  const std::string file = socket_file_of(address);
  if (!file.empty()) remove_if_dead(file, native, size);
  if (bind(socket.number(), reinterpret_cast<const sockaddr*>(&native), size) != 0 ||
      listen(socket.number(), kBacklog) != 0) {
    const int error = errno;
    return unexpected{not_served(
        address, std::strerror(error),
        error == EADDRINUSE
            ? "end the program that has it (ss -xlp), or choose another port, or serve without "
              "shared memory."
            : "give a folder that is there and may be written, or none, or serve without shared "
              "memory.")};
  }
  return SharedMemoryListener(std::move(socket), file);
}

SharedMemoryListener::SharedMemoryListener(Descriptor socket, std::string file) noexcept
    : socket_(std::move(socket)), spare_(spare_descriptor()), file_(std::move(file)) {}

SharedMemoryListener::~SharedMemoryListener() {
  if (socket_.is_open() && !file_.empty()) unlink(file_.c_str());
}

Accepted SharedMemoryListener::accept() noexcept {
  return accept_or_turn_away(socket_.number(), spare_);
}

SharedMemoryClient welcome_shared_memory_client(Descriptor socket, const UserPolicy* policy) {
  std::array<std::byte, SetupRequest::kSize + 1> message{};
  // A descriptor received with it is closed here.
  const ReceivedMessage received = receive_message(socket.number(), message);
  const auto request = decode_request(ConstBytes(message).first(received.size));
  if (!request) return {};
  SetupStatus status = SetupStatus::kOk;
  if (!request->is_our_version) status = SetupStatus::kVersionUnsupported;
  // hp-16.1-4
  if (!is_admitted(socket.number(), policy)) status = SetupStatus::kNotAllowed;
  if (status != SetupStatus::kOk || request->request.only_asks) {
    refuse(socket.number(), status);
    return {};
  }
  const Descriptor memory = make_memory("rtpm", memory_size(kRingSizes));
  SharedMapping mapping(memory.number(), memory_size(kRingSizes));
  Descriptor event(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC));
  if (!memory.is_open() || !seal_memory(memory.number()) || !event.is_open() ||
      mapping.bytes().empty()) {
    const int error = errno;
    refuse(socket.number(), SetupStatus::kNoMemory);
    return {.shortage = error};
  }
  const auto answer = encode(SetupAnswer{.sizes = kRingSizes});
  const std::array descriptors{memory.number(), event.number()};
  if (!send_message(socket.number(), answer, descriptors)) return {};
  return {request->request.priority, std::make_unique<SharedMemoryConnection>(
                                         std::move(socket), std::move(event), std::move(mapping),
                                         kRingSizes, SharedMemoryConnection::Side::kServer)};
}

}  // namespace rtpm::transport
