#pragma once

#include <exception>
#include <string>
#include <utility>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::driver_host {

/// Calls into a plug-in; turns an exception into an error by `to_result`.
template <class Call, class ToResult>
auto guarded_by(Call&& call, ToResult&& to_result) -> decltype(call()) {
  // Copies the text before the exception is destroyed: its type may belong to the plug-in.
  try {
    return std::forward<Call>(call)();
  } catch (const std::exception& exception) {
    return to_result(std::string("it threw: ") + exception.what());
  } catch (...) {
    return to_result(std::string("it threw something that is no std::exception"));
  }
}

/// Calls `where` of the plug-in in `file`; turns an exception into an error.
template <class Call>
auto guarded(const std::string& file, const char* where, Call&& call) -> decltype(call()) {
  return guarded_by(std::forward<Call>(call), [&](std::string why) {
    return unexpected{SetupError{.what = "the driver of plug-in " + file + " failed in " + where,
                                 .why = std::move(why),
                                 .remedy = "ask its author; a driver returns errors"}};
  });
}

}  // namespace rtpm::driver_host
