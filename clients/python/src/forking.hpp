#pragma once

#include <unistd.h>

#include <memory>

namespace rtpm::python {

/// Deletes an object in the process that made it. In a forked child its threads do not exist, and
/// its connections are the parent's, so there the object stays as it is.
template <class T>
struct DeleteByMaker {
  pid_t maker = ::getpid();
  void operator()(T* object) const noexcept {
    if (::getpid() == maker) delete object;
  }
};

/// Owns an object that a forked child leaves alone.
template <class T>
using Unforked = std::unique_ptr<T, DeleteByMaker<T>>;

template <class T>
[[nodiscard]] Unforked<T> unforked(std::unique_ptr<T> object) noexcept {
  return Unforked<T>(object.release());
}

}  // namespace rtpm::python
