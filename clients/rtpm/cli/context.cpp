#include "cli/context.hpp"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "rtpm/base/printable.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::tool {

SetupError named(const std::string& subject, SetupError error) {
  error.what = subject + ": " + error.what;
  return error;
}

rpc::Node& Context::node() {
  if (!node_) {
    node_ = std::make_unique<rpc::Node>(rpc::NodeConfig{.security = security});
    resolver_ = std::make_unique<names::RegistryResolver>(*node_, registry);
    node_->use(*resolver_);
  }
  return *node_;
}

const program::StopSignal& Context::stop() {
  if (!stop_) stop_ = std::make_unique<program::StopSignal>(program::LostOutput::kRequestsEnd);
  return *stop_;
}

rpc::CallOptions Context::call_options() const {
  return {.priority = priority, .deadline = deadline, .trace_id = 0};
}

int Context::fail(const SetupError& error, ExitCode code) const {
  if (!json) {
    rt::print_error("rtpm", error.text());
    return code;
  }
  nlohmann::ordered_json told{{"what", printable(error.what, kShownWhole)}};
  if (!error.why.empty()) told["why"] = printable(error.why, kShownWhole);
  if (!error.remedy.empty()) told["remedy"] = printable(error.remedy, kShownWhole);
  told["exit_code"] = static_cast<int>(code);
  const std::string line = nlohmann::ordered_json{{"error", std::move(told)}}.dump();
  std::fprintf(stderr, "%s\n", line.c_str());
  return code;
}

int Context::fail(std::string_view what, ExitCode code) const {
  return fail(SetupError{std::string(what)}, code);
}

int Context::fail_at(std::string_view what, const std::string& text,
                     const predicate::TextError& error) const {
  if (!json) {
    const std::string picture = error.picture(text);
    const std::size_t end = picture.find('\n');
    rt::print_error("rtpm", picture.substr(0, end));
    rt::print_error("rtpm", picture.substr(end + 1) + " " + error.what);
    return kMisused;
  }
  return fail("the " + std::string(what) + ", at character " + std::to_string(error.offset) + ": " +
                  error.what,
              kMisused);
}

int Context::not_reached(const SetupError& error) const {
  const bool is_own_lack = error.cause == rpc::CallError::kNoResources ||
                           error.cause.category() == std::generic_category();
  return fail(error, is_own_lack ? kFailed : kNotReached);
}

}  // namespace rtpm::tool
