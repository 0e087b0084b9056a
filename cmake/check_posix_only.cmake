# Whether archives call nothing that only Linux has, but for `syscall`, which std::counting_semaphore makes there: cmake -D NM=nm -D ARCHIVES=a;b -P this.
set(linux "epoll_[a-z0-9_]+|eventfd[a-z_]*|timerfd_[a-z]+|signalfd|memfd_create|accept4|ppoll|pipe2|dup3|prctl"
  "|sem_[a-z]+|pthread_[a-z]+_clock[a-z]+|(send|recv)mmsg|gettid|pthread_[sg]et(affinity|name)_np|sched_[sg]etaffinity"
  "|clock_nanosleep|mallopt|explicit_bzero|getrandom|adjtimex|inotify_[a-z_0-9]+|mlockall")
string(CONCAT linux ${linux})
foreach(archive ${ARCHIVES})
  execute_process(COMMAND ${NM} --undefined-only --format=just-symbols ${archive} OUTPUT_VARIABLE symbols
    COMMAND_ERROR_IS_FATAL ANY)
  string(REGEX MATCHALL "\n(${linux})\n" found "${symbols}")
  if(found)
    string(REPLACE "\n" " " found "${found}")
    message(FATAL_ERROR "${archive} calls what POSIX does not have everywhere:${found}")
  endif()
endforeach()
