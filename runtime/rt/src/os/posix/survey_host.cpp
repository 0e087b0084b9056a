#include "rtpm/rt/survey.hpp"

namespace rtpm::rt {

std::vector<Finding> survey_host(const std::vector<int>& process_ids) {
  const HostAnswers answers = ask_host();
  return judge_host(read_host("", process_ids), answers);
}

}  // namespace rtpm::rt
