package org.rtpm.internal;

import java.util.ArrayDeque;
import java.util.Deque;
import java.util.concurrent.locks.ReentrantLock;

/** Tasks that wait until a lock is released. Whoever has released it runs them, in their order. */
public final class DeferredTasks {
  private final ReentrantLock lock;
  private final Deque<Runnable> tasks = new ArrayDeque<>();
  private volatile boolean isEmpty = true;

  /** Makes none, for this lock. */
  public DeferredTasks(ReentrantLock lock) {
    this.lock = lock;
  }

  /** Adds a task. Only with the lock held. */
  public void add(Runnable task) {
    tasks.add(task);
    isEmpty = false;
  }

  /** Runs the tasks, if the lock is released: a thread that holds it still will run them later. */
  public void run() {
    if (lock.isHeldByCurrentThread()) {
      return;
    }
    while (!isEmpty) {
      Runnable next;
      lock.lock();
      try {
        next = tasks.poll();
        isEmpty = tasks.isEmpty();
      } finally {
        lock.unlock();
      }
      if (next != null) {
        next.run();
      }
    }
  }
}
