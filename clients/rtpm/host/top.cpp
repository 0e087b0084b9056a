#include <unistd.h>

#include <string>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "host/commands.hpp"
#include "host/screen.hpp"
#include "host/top_picture.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::tool {
namespace {

struct TopRequest {
  Duration interval = std::chrono::seconds{1};
  bool is_once = false;
};

/// The longest time until a key press or Ctrl-C is handled.
constexpr Duration kKeyTime = std::chrono::milliseconds{50};
constexpr const char* kFooter =
    " q quit   p pause   c sort by calls   l longest   d drops   s server ";

void print(const Context& context, const TopState& state) {
  if (context.json) {
    print_json(json_of(state));
    return;
  }
  const TopPicture picture = picture_of(state);
  std::string text = picture.summary + "\n";
  for (const auto* table : {&picture.lanes, &picture.devices}) {
    text += "\n";
    for (const std::string& line : *table)
      text += line + "\n";
  }
  print_line(text);
}

/// The state that key presses change.
struct View {
  SortKey key = SortKey::kCalls;
  bool is_paused = false;
  bool is_left = false;

  /// @return whether the picture must be redrawn at once
  bool take(int pressed) {
    switch (pressed) {
      case 'q':
        is_left = true;
        return true;
      case 'p':
        is_paused = !is_paused;
        return true;
      case 'c':
        key = SortKey::kCalls;
        return true;
      case 'l':
        key = SortKey::kLongest;
        return true;
      case 'd':
        key = SortKey::kDrops;
        return true;
      case 's':
        key = SortKey::kServer;
        return true;
      default:
        return false;
    }
  }
};

std::string header_of(const Context& context, const View& view) {
  return "rtpm top  " + context.registry + "  sorted by " + std::string(to_string(view.key)) +
         (view.is_paused ? "  PAUSED" : "");
}

int show_live(Context& context, const TopRequest& request, TopObserver& observer) {
  const program::StopSignal& stop = context.stop();
  Screen screen;
  View view;
  TopState state;
  MonotonicTime next{};
  while (!view.is_left && !stop.is_requested()) {
    if (!view.is_paused && rt::now() >= next) {
      state = observer.look(view.key);
      next = rt::now() + request.interval;
      screen.show(picture_of(state), header_of(context, view), kFooter);
    }
    if (view.take(screen.key(kKeyTime))) {
      if (!view.is_paused) next = MonotonicTime{};
      screen.show(picture_of(state), header_of(context, view), kFooter);
    }
  }
  return kDone;
}

int top(Context& context, const TopRequest& request) {
  const program::StopSignal& stop = context.stop();
  TopObserver observer(context);
  const bool is_live = is_terminal() && ::isatty(STDIN_FILENO) == 1 && !context.json;
  if (is_live && !request.is_once) return show_live(context, request, observer);
  // Looks twice, because rates need two looks.
  static_cast<void>(observer.look(SortKey::kCalls));
  do {
    if (stop.wait_for(request.interval)) break;
    print(context, observer.look(SortKey::kCalls));
  } while (!request.is_once && context.json);
  return kDone;
}

}  // namespace

void add_top(CLI::App& program, Context& context) {
  const auto request = std::make_shared<TopRequest>();
  CLI::App& command = add_command(
      program, context, "top", "Show lanes and devices live: rates, drops, times",
      "Lanes are those of this host's servers, devices those that the registry names. READ is the\n"
      "time of a call that reads the device, from here. Where standard output is no terminal, it\n"
      "prints one picture; with --json one per interval, until Ctrl-C.\n",
      [request](Context& c) { return top(c, *request); });
  add_duration(command, "--interval", request->interval, "From one look to the next",
               {std::chrono::milliseconds{100}, std::chrono::minutes{10}});
  command.add_flag("--once", request->is_once, "Print one picture, and end");
}

}  // namespace rtpm::tool
