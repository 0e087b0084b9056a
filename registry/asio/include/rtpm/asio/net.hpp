#pragma once

/// The Asio in use: standalone Asio 1.22 or later, or Boost.Asio 1.74 or later where
/// RTPM_ASIO_BOOST is defined, as by `target_compile_definitions(program PRIVATE RTPM_ASIO_BOOST)`.
/// Both may be in one program, in different source files.
// IWYU pragma: begin_exports
#ifdef RTPM_ASIO_BOOST
#if !__has_include(<boost/asio/any_io_executor.hpp>)
#error "RTPM_ASIO_BOOST needs Boost.Asio 1.74 or later: install the Debian package libboost-dev"
#endif
#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/associated_allocator.hpp>
#include <boost/asio/associated_executor.hpp>
#include <boost/asio/async_result.hpp>
#include <boost/asio/error.hpp>
#include <boost/asio/execution_context.hpp>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#ifdef BOOST_ASIO_HAS_POSIX_STREAM_DESCRIPTOR
#include <boost/asio/posix/stream_descriptor.hpp>
#define RTPM_ASIO_HAS_DESCRIPTORS 1
#else
#include <boost/asio/ip/udp.hpp>
#endif
#include <boost/asio/post.hpp>
#include <boost/asio/query.hpp>
#if __has_include(<boost/asio/associated_cancellation_slot.hpp>)
#include <boost/asio/associated_cancellation_slot.hpp>
#define RTPM_ASIO_HAS_SLOTS 1
#endif
#define RTPM_ASIO_FLAVOUR with_boost
#else
#if !__has_include(<asio/any_io_executor.hpp>)
#error "rtpm::asio needs Asio: install the Debian package libasio-dev, or define RTPM_ASIO_BOOST"
#endif
#include <asio/any_io_executor.hpp>
#include <asio/associated_allocator.hpp>
#include <asio/associated_cancellation_slot.hpp>
#include <asio/associated_executor.hpp>
#include <asio/async_result.hpp>
#include <asio/error.hpp>
#include <asio/execution_context.hpp>
#include <asio/executor_work_guard.hpp>
#include <asio/io_context.hpp>
#ifdef ASIO_HAS_POSIX_STREAM_DESCRIPTOR
#include <asio/posix/stream_descriptor.hpp>
#define RTPM_ASIO_HAS_DESCRIPTORS 1
#else
#include <asio/ip/udp.hpp>
#endif
#include <asio/post.hpp>
#include <asio/query.hpp>
#define RTPM_ASIO_HAS_SLOTS 1
#define RTPM_ASIO_FLAVOUR standalone
#endif
// IWYU pragma: end_exports

#include <optional>
#include <string>
#include <system_error>

#include "rtpm/rpc/error.hpp"

/// RTPM in the event loops of Asio: calls, streams, events and watches of names as asynchronous
/// operations that take any completion token.
///
/// Operations complete with an error_code and a value, as those of Asio and of the libraries on it:
/// use_awaitable and use_future throw the error, redirect_error and as_tuple return it, and groups
/// of operations (`||`, `&&`, parallel_group) see it. Code that wants RTPM's values uses as_tuple.
/// The error is code_of() a CallError. A cancelled operation completes with operation_aborted.
namespace rtpm::asio {
inline namespace RTPM_ASIO_FLAVOUR {

#ifdef RTPM_ASIO_BOOST
namespace net = boost::asio;
using ErrorCode = boost::system::error_code;
using ErrorCategory = boost::system::error_category;
#else
namespace net = ::asio;
using ErrorCode = std::error_code;
using ErrorCategory = std::error_category;
#endif

/// A descriptor of RTPM's, in a loop.
#ifdef RTPM_ASIO_HAS_DESCRIPTORS
using Watched = net::posix::stream_descriptor;
inline void assign(Watched& watched, int descriptor, ErrorCode& error) {
  static_cast<void>(watched.assign(descriptor, error));
}
/// Leaves the descriptor to RTPM.
inline void give_back(Watched& watched) noexcept {
  static_cast<void>(watched.release());
}
#else  // On Windows it is a socket, to which the loop has a handle of its own.
using Watched = net::ip::udp::socket;
inline void assign(Watched& watched, int descriptor, ErrorCode& error) {
  WSAPROTOCOL_INFOW known{};
  SOCKET own = INVALID_SOCKET;
  if (::WSADuplicateSocketW(static_cast<SOCKET>(descriptor), ::GetCurrentProcessId(), &known) ==
      0) {
    own = ::WSASocketW(FROM_PROTOCOL_INFO, FROM_PROTOCOL_INFO, FROM_PROTOCOL_INFO, &known, 0,
                       WSA_FLAG_OVERLAPPED);
  }
  if (own == INVALID_SOCKET) {
    error.assign(::WSAGetLastError(), net::error::get_system_category());
    return;
  }
  static_cast<void>(watched.assign(net::ip::udp::v4(), own, error));
  if (error) ::closesocket(own);
}
inline void give_back(Watched&) noexcept {}
#endif

/// The codes of rpc::CallError, with the messages of rpc::to_string().
[[nodiscard]] inline const ErrorCategory& call_category() noexcept {
#ifdef RTPM_ASIO_BOOST
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wnon-virtual-dtor"  // Boost's base class has none.
  class Category final : public ErrorCategory {
    const char* name() const noexcept override { return "call"; }
    std::string message(int value) const override {
      return std::string(rpc::to_string(static_cast<rpc::CallError>(value - 1)));
    }
  };
#pragma GCC diagnostic pop
  static const Category category;
  return category;
#else
  return rpc::make_error_code(rpc::CallError{}).category();
#endif
}

/// The code with which an operation reports `error`; that of kCancelled is operation_aborted.
/// `code == code_of(rpc::CallError::kTimeout)` compares.
[[nodiscard]] inline ErrorCode code_of(rpc::CallError error) noexcept {
  if (error == rpc::CallError::kCancelled) return net::error::operation_aborted;
  return {rpc::make_error_code(error).value(), call_category()};
}

/// The CallError of a code; nullopt for codes of Asio and of others.
[[nodiscard]] inline std::optional<rpc::CallError> error_of(const ErrorCode& code) noexcept {
  if (code == net::error::operation_aborted) return rpc::CallError::kCancelled;
  if (code.category() != call_category() || !code) return std::nullopt;
  return static_cast<rpc::CallError>(code.value() - 1);
}

}  // namespace RTPM_ASIO_FLAVOUR
}  // namespace rtpm::asio
