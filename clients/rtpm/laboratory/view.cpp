#include "laboratory/view.hpp"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <utility>

#include "laboratory/status_table.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/options/formatted.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::tool {
namespace {

using laboratory::Output;
using laboratory::ProgramStatus;
using laboratory::State;

constexpr std::size_t kHiddenLineMax = 10;
constexpr std::size_t kKeptSizeMax = std::size_t{256} * 1024;
constexpr Duration kDrawPeriod = std::chrono::seconds{1};
/// The shortest interval of redraws, for a program that prints without end.
constexpr Duration kDrawPause = std::chrono::milliseconds{50};

struct Extent {
  std::size_t columns = 80;
  std::size_t rows = 24;
};

Extent terminal_extent() {
  winsize size{};
  if (::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0 || size.ws_row == 0)
    return {};
  return {size.ws_col, size.ws_row};
}

void put(std::string_view text) {
  std::fwrite(text.data(), 1, text.size(), stdout);
  std::fflush(stdout);
}

}  // namespace

LaboratoryView::LaboratoryView(const laboratory::Plan& plan, bool as_json, bool is_quiet)
    : plan_(plan),
      is_json_(as_json),
      is_quiet_(is_quiet && !as_json),
      has_table_(is_terminal() && !as_json && !is_quiet),
      begin_(rt::now()),
      shown_(plan.programs.size()) {}

double LaboratoryView::elapsed_s() const {
  return std::chrono::duration<double>(rt::now() - begin_).count();
}

void LaboratoryView::print(std::string line) {
  line += '\n';
  if (log_) {
    log_->write(std::string_view(line).substr(0, line.size() - 1));
  } else if (has_table_) {
    pending_ += line;
  } else {
    put(line);
  }
}

void LaboratoryView::print_event(const Json& event) {
  Json document{{"time_s", elapsed_s()}};
  document.update(event);
  print(document.dump(-1, ' ', false, Json::error_handler_t::replace));
}

void LaboratoryView::on_change(std::size_t program, const ProgramStatus& status) {
  must_draw_ = true;
  Shown& shown = shown_[program];
  if (shown.state == status.state && shown.process == status.process) return;
  shown.state = status.state;
  shown.process = status.process;
  shown.note = status.note;
  const std::string& name = plan_.programs[program].name;
  const std::string state(to_string(status.state));
  // A process is started before its number is known.
  if (status.state == State::kStarting && status.process == 0) return;
  if (is_json_) {
    print_event({{"event", "state"},
                 {"program", name},
                 {"state", state},
                 {"process", status.process},
                 {"restarts", status.restart_count},
                 {"url", status.url},
                 {"note", status.note}});
    return;
  }
  const bool is_trouble = status.state == State::kFailed || status.state == State::kPausing;
  const std::string note = status.note.empty() ? "" : ": " + printable(status.note);
  if (is_quiet_ && !log_) {
    if (is_trouble) rt::print_error("rtpm", name + ": " + state + note);
  } else if (!has_table_ || is_trouble) {
    std::string line = options::formatted("[%7.1f s] ", elapsed_s()) + name + ": " +
                       (has_table_ ? coloured(state, colour_of(status.state)) : state) + note;
    if (status.state == State::kServing && !status.url.empty())
      line += " at " + printable(status.url);
    if (status.process > 0) line += ", process " + std::to_string(status.process);
    print(std::move(line));
  }
  if (status.state == State::kFailed) show_hidden(program);
}

void LaboratoryView::on_output(std::size_t program, bool is_error, std::string_view line) {
  const laboratory::ProgramPlan& plan = plan_.programs[program];
  if (plan.output == Output::kEnd && !is_json_) {
    std::string& kept = shown_[program].kept;
    kept += printable(line, kShownWhole) + "\n";
    if (kept.size() > kKeptSizeMax) kept.erase(0, kept.find('\n', kept.size() - kKeptSizeMax) + 1);
    return;
  }
  const bool is_shown = plan.output == Output::kLines || plan.output == Output::kTerminal ||
                        plan.output == Output::kEnd || (plan.output == Output::kErrors && is_error);
  if (!is_shown) return hide(program, line);
  if (is_json_) {
    print_event({{"event", "output"},
                 {"program", plan.name},
                 {"stream", is_error ? "stderr" : "stdout"},
                 {"line", line}});
    return;
  }
  const std::string prefix = plan.name + " | ";
  print((has_table_ ? coloured(prefix, Colour::kGrey) : prefix) + printable(line, kShownWhole));
}

void LaboratoryView::hide(std::size_t program, std::string_view line) {
  std::deque<std::string>& hidden = shown_[program].hidden;
  hidden.push_back(printable(line));
  if (hidden.size() > kHiddenLineMax) hidden.pop_front();
}

/// Shows the last lines of a failed program, because they usually explain its failure.
void LaboratoryView::show_hidden(std::size_t program) {
  for (const std::string& line : std::exchange(shown_[program].hidden, {}))
    print(plan_.programs[program].name + " | " + line);
}

void LaboratoryView::on_up() {
  if (is_json_) return print_event({{"event", "up"}, {"laboratory", plan_.name}});
  if (!is_quiet_ && !has_table_)
    print(options::formatted("[%7.1f s] ", elapsed_s()) + plan_.name + " is up");
}

void LaboratoryView::on_stop(std::string_view why) {
  if (is_json_) return print_event({{"event", "stopping"}, {"why", why}});
  if (!is_quiet_ || log_)
    print(options::formatted("[%7.1f s] ", elapsed_s()) + plan_.name +
          " ends: " + std::string(why));
}

void LaboratoryView::on_turn(const laboratory::Supervision& supervision) {
  if (!has_table_ || log_) return;
  const MonotonicTime now = rt::now();
  const bool is_due = now >= next_draw_ && (!pending_.empty() || now >= last_draw_ + kDrawPeriod);
  if (!must_draw_ && !is_due) return;
  must_draw_ = false;
  last_draw_ = now;
  next_draw_ = now + kDrawPause;
  draw(supervision, now);
}

void LaboratoryView::draw(const laboratory::Supervision& supervision, MonotonicTime now) {
  const Extent extent = terminal_extent();
  std::vector<std::string> lines = status_table(plan_, supervision, now, extent.columns - 1);
  // A table that is higher than the screen could not be redrawn in place.
  if (lines.size() + 1 >= extent.rows) lines.resize(std::max<std::size_t>(1, extent.rows - 2));
  std::string text;
  if (table_height_ > 0) text += "\r\x1b[" + std::to_string(table_height_) + "A\x1b[J";
  text += std::exchange(pending_, {});
  for (const std::string& line : lines)
    text += line + "\n";
  table_height_ = lines.size();
  put(text);
}

void LaboratoryView::move_to(laboratory::LogFile log) {
  has_table_ = false;
  log_ = std::move(log);
}

void LaboratoryView::finish() {
  if (!pending_.empty()) put(std::exchange(pending_, {}));
  for (std::size_t i = 0; i < shown_.size(); ++i) {
    const std::string kept = std::exchange(shown_[i].kept, {});
    if (kept.empty()) continue;
    if (log_) {
      log_->write(kept.substr(0, kept.size() - 1));
    } else {
      put("\n" + kept);
    }
  }
}

std::string LaboratoryView::failed_programs() const {
  std::string list;
  for (std::size_t i = 0; i < shown_.size(); ++i) {
    if (shown_[i].state != State::kFailed) continue;
    list += (list.empty() ? "" : "; ") + plan_.programs[i].name + ": " + shown_[i].note;
  }
  return list;
}

}  // namespace rtpm::tool
