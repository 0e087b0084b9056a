#pragma once

#include <string>

/// Commands about the program that listens at a port.
namespace rtpm::rt::os {

/// Ends the program.
[[nodiscard]] inline std::string end_of_process(int process_id) {
  return "taskkill /F /PID " + std::to_string(process_id);
}
/// Shows the program to an administrator.
[[nodiscard]] inline std::string search_for_holder(const std::string& port) {
  return "netstat -ano | findstr :" + port;
}

}  // namespace rtpm::rt::os
