#pragma once

#include <nanobind/nanobind.h>

#include <optional>
#include <utility>

#include "binding.hpp"
#include "rtpm/rpc/async.hpp"

namespace rtpm::python {

/// The items of a call.
/// @ownership keeps its binding
/// @threads   with the GIL
class Stream {
 public:
  Stream(nanobind::object owner, Binding& binding, std::size_t index, rpc::ItemReader reader)
      : owner_(std::move(owner)),
        binding_(binding),
        index_(index),
        reader_(new rpc::ItemReader(std::move(reader))) {}

  /// The next item.
  /// @errors raises StopIteration after the last one, Timeout if none arrives in time
  [[nodiscard]] nanobind::object next(std::optional<double> timeout);
  /// The next item, if it is here: (True, item). Else (False, descriptor, seconds): to try again
  /// when the descriptor is readable or the time is over. None after the last item.
  [[nodiscard]] nanobind::object try_next();
  void cancel();

 private:
  nanobind::object owner_;
  Binding& binding_;
  std::size_t index_;
  Unforked<rpc::ItemReader> reader_;
};

}  // namespace rtpm::python
