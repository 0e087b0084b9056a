#include "stream.hpp"

#include <algorithm>

#include "errors.hpp"
#include "rtpm/rt/clock.hpp"
#include "waiting.hpp"

namespace nb = nanobind;

namespace rtpm::python {

nb::object Stream::next(std::optional<double> timeout) {
  const auto span = span_of(timeout);
  const MonotonicTime end = span ? deadline_after(*span, rt::now()) : kNever;
  expected<std::optional<ConstBytes>, rpc::CallError> item{std::nullopt};
  wait_in_slices([&] {
    item = reader_->next(std::min(end, rt::now() + kSlice));
    return item || item.error() != rpc::CallError::kTimeout || !reader_->is_open() ||
           rt::now() >= end;
  });
  if (!item) binding_.fail(index_, item.error());
  if (!*item) raise_stop_iteration();
  return binding_.decode(index_, **item);
}

nb::object Stream::try_next() {
  const auto item = reader_->next(MonotonicTime{});
  if (item) {
    if (!*item) return nb::none();
    return nb::make_tuple(true, binding_.decode(index_, **item));
  }
  if (item.error() != rpc::CallError::kTimeout || !reader_->is_open()) {
    binding_.fail(index_, item.error());
  }
  const rpc::Readiness readiness = reader_->readiness();
  const auto left = std::clamp(readiness.due - rt::now(), Duration{0}, Duration{kSlice * 20});
  return nb::make_tuple(false, readiness.descriptor, static_cast<double>(left.count()) * 1e-9);
}

void Stream::cancel() {
  const Released released;
  reader_->cancel();
}

}  // namespace rtpm::python
