#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "rtpm/options/options.hpp"
#include "rtpm/test/environment.hpp"
#include "rtpm/test/temporary_folder.hpp"

namespace rtpm::options {

/// A program of its own with an environment, a file and a command line.
class Program : public testing::Test {
 protected:
  using Arguments = std::vector<std::string>;

  void TearDown() override {
    for (const std::string& name : variables_)
      unsetenv(name.c_str());
  }
  void set_variable(const std::string& name, const std::string& value) {
    variables_.insert(name);
    setenv(name.c_str(), value.c_str(), 1);
  }
  [[nodiscard]] std::string file_with(const std::string& text) const {
    return folder_.write("options.toml", text);
  }
  /// The arguments of a line, which blanks divide.
  static Arguments words(const std::string& line) {
    std::istringstream stream(line);
    return {std::istream_iterator<std::string>(stream), {}};
  }

  /// Adds the program's options.
  virtual void add(Options& options) = 0;
  /// Parses arguments; `out_` and `err_` get what is printed.
  std::optional<int> parse(const Arguments& arguments) {
    Options options("rtpm-test", "tries options");
    add(options);
    std::vector<const char*> argv{"rtpm-test"};
    for (const std::string& argument : arguments)
      argv.push_back(argument.c_str());
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    const auto exit_code = options.parse(static_cast<int>(argv.size()), argv.data());
    out_ = testing::internal::GetCapturedStdout();
    err_ = testing::internal::GetCapturedStderr();
    return exit_code;
  }
  void expect_parsed(const Arguments& arguments) {
    EXPECT_EQ(parse(arguments), std::nullopt);
    EXPECT_EQ(out_ + err_, "");
  }
  void expect_output(const Arguments& arguments, const Arguments& parts) {
    EXPECT_EQ(parse(arguments), 0);
    EXPECT_EQ(err_, "");
    for (const std::string& part : parts)
      EXPECT_NE(out_.find(part), out_.npos) << part << " is not in:\n" << out_;
  }
  /// Expects an error of one line that contains all of `parts`.
  void expect_error(const Arguments& arguments, const Arguments& parts) {
    EXPECT_EQ(parse(arguments), 2);
    EXPECT_EQ(out_, "");
    EXPECT_EQ(std::ranges::count(err_, '\n'), 1) << err_;
    EXPECT_TRUE(err_.starts_with("rtpm-test: ")) << err_;
    EXPECT_NE(err_.find("run 'rtpm-test --help'"), err_.npos) << err_;
    for (const std::string& part : parts)
      EXPECT_NE(err_.find(part), err_.npos) << part << " is not in: " << err_;
  }
  void expect_file_error(const std::string& text, const Arguments& parts) {
    expect_error({"--config", file_with(text)}, parts);
  }

  std::string out_;
  std::string err_;

 private:
  std::set<std::string> variables_;
  test::TemporaryFolder folder_;
};

}  // namespace rtpm::options
