#include <memory>

#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "recordings/commands.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/exports/video.hpp"

namespace rtpm::tool {
namespace {

expected<exports::VideoReport, SetupError> cut_out(Context& context, const std::string& file,
                                                   const std::string& output,
                                                   const std::string& medium) {
  ProgressBar bar(context, "exporting");
  const auto show = [&bar](auto part, auto whole) { return bar.show(part, whole); };
  const auto reader = recording::FileReader::open(file, recording::Incomplete::kRefuse, show);
  if (!reader) return unexpected{reader.error()};
  return exports::export_video(**reader, output, medium, show);
}

}  // namespace

int export_video(Context& context, const std::string& file, const std::string& output,
                 const std::string& medium) {
  const auto done = cut_out(context, file, output, medium);
  if (!done) return context.fail(done.error());
  if (context.json) {
    print_json({{"output", output},
                {"medium", done->medium},
                {"picture_count", done->picture_count},
                {"sound_count", done->sound_count},
                {"left_out_count", done->left_out_count}});
  } else {
    print_line(printable(output) + " has " + std::to_string(done->picture_count) + " pictures of " +
               printable(done->medium) + ", and " + std::to_string(done->sound_count) +
               " pieces of sound");
    if (done->left_out_count > 0) {
      print_line(std::to_string(done->left_out_count) +
                 " pictures before the first key frame were left out");
    }
  }
  return done->left_out_count == 0 ? kDone : kFailed;
}

}  // namespace rtpm::tool
