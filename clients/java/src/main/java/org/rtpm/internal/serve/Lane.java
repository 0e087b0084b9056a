package org.rtpm.internal.serve;

import java.util.ArrayList;
import java.util.List;
import java.util.PriorityQueue;
import java.util.concurrent.Executor;
import java.util.concurrent.TimeUnit;
import java.util.concurrent.locks.Condition;
import java.util.concurrent.locks.ReentrantLock;
import java.util.function.Predicate;
import java.util.function.Supplier;
import org.rtpm.Status;
import org.rtpm.internal.DeferredTasks;
import org.rtpm.internal.sealed.KeyPair;
import org.rtpm.internal.sealed.SealedServer;
import org.rtpm.internal.sealed.Sealing;
import org.rtpm.internal.sealed.Suite;
import org.rtpm.internal.wire.Bytes;
import org.rtpm.internal.wire.DropReason;
import org.rtpm.internal.wire.Limits;
import org.rtpm.internal.wire.Medium;
import org.rtpm.internal.wire.Peer;
import org.rtpm.internal.wire.ServerSessions;
import org.rtpm.internal.wire.SipHash;
import org.rtpm.values.Kind;
import org.rtpm.values.Operation;

/**
 * A lane of a server: the sessions of a band of priorities, and the threads that run their calls in
 * the order of priority.
 */
public final class Lane implements ServerSessions.Handler {
  /**
   * How the lanes of a server are set up.
   *
   * @param queueSizeMax how many calls may wait in a lane
   * @param own the server's key; null: sessions are not sealed
   * @param presharedKey 32 bytes
   * @param admission which clients may come, of a sealed server
   * @param grants what they may do; null: everything
   * @param trusted whether a client may do everything all the same
   * @param keyWorker does the work with keys
   */
  public record Config(
      long epoch,
      long clockDomain,
      SipHash key,
      int laneCount,
      int ceiling,
      int sessionCountMax,
      int messageSizeMax,
      int largeCountMax,
      int streamCountMax,
      int queueSizeMax,
      KeyPair own,
      byte[] presharedKey,
      SealedServer.Admission admission,
      GrantFile grants,
      Predicate<byte[]> trusted,
      Executor keyWorker) {}

  /** Sends the frames of a medium. */
  public interface Sender {
    void send(Medium medium, Peer peer, byte[] frame);
  }

  public final int low;
  public final int high;
  private final Config config;
  private final ObjectTable objects;
  private final ReentrantLock lock = new ReentrantLock();
  private final Condition hasCall = lock.newCondition();
  private final Condition isIdle = lock.newCondition();
  private final ServerSessions[] sessions = new ServerSessions[2];
  private final SealedServer[] seals = new SealedServer[2];
  private final PriorityQueue<ServedCall> queue = new PriorityQueue<>();
  private final DeferredTasks later = new DeferredTasks(lock);
  private final List<Thread> threads = new ArrayList<>();
  private long callCount;
  private int runningCount;
  private Grants grants;
  private long grantsDue = Limits.NEVER;
  private boolean isStopping;
  /** The sessions are closed: nothing is answered any more, so that clients ask the next server. */
  private boolean isStopped;

  /**
   * Starts a lane.
   *
   * @param number of the lane, from 0
   * @param threadCount how many calls run at a time
   */
  public Lane(
      Config config,
      int number,
      int low,
      int high,
      int threadCount,
      ObjectTable objects,
      Sender sender) {
    this.config = config;
    this.objects = objects;
    this.low = low;
    this.high = high;
    for (Medium medium : Medium.values()) {
      open(medium, number, sender);
    }
    if (config.grants != null) {
      grantsDue = System.nanoTime() + GrantFile.LOOK_INTERVAL;
    }
    for (int i = 0; i < threadCount; ++i) {
      Thread thread = new Thread(this::work, "rtpm-lane" + number + "-" + i);
      thread.setDaemon(true);
      threads.add(thread);
      thread.start();
    }
  }

  private void open(Medium medium, int number, Sender sender) {
    ServerSessions.Sink transport = (peer, frame) -> sender.send(medium, peer, frame);
    SealedServer seal = null;
    if (config.own != null) {
      seal =
          new SealedServer(
              new SealedServer.Config(
                  medium,
                  config.own,
                  config.presharedKey,
                  Suite.ALL,
                  config.admission,
                  config.key,
                  config.sessionCountMax,
                  config.keyWorker,
                  task ->
                      locked(
                          () -> {
                            task.run();
                            return null;
                          }),
                  System::nanoTime),
              transport);
    }
    ServerSessions opened =
        new ServerSessions(
            new ServerSessions.Config(
                medium,
                low,
                high,
                config.ceiling,
                config.epoch,
                config.clockDomain,
                config.key,
                number,
                config.laneCount,
                config.sessionCountMax,
                config.messageSizeMax,
                config.largeCountMax,
                config.streamCountMax,
                seal == null ? Integer.MAX_VALUE : Sealing.payloadSizeMax(medium)),
            seal == null ? transport : seal::send,
            this);
    if (seal != null) {
      seal.attach(opened);
    }
    sessions[medium.ordinal()] = opened;
    seals[medium.ordinal()] = seal;
  }

  /** Runs the task with the lane locked, and then what it left for later. */
  <T> T locked(Supplier<T> task) {
    T result;
    lock.lock();
    try {
      result = task.get();
    } finally {
      lock.unlock();
    }
    later.run();
    return result;
  }

  /** Has the task run when the lane is unlocked. Only with the lane locked. */
  void later(Runnable task) {
    later.add(task);
  }

  // ---- frames -----------------------------------------------------------------------------------

  /** Takes a frame in. Returns false if the connection is to be ended. */
  public boolean onFrame(Medium medium, byte[] frame, Peer peer, long now) {
    int at = medium.ordinal();
    return locked(
        () -> {
          if (isStopped) {
            return medium == Medium.DATAGRAM;
          }
          return seals[at] == null
              ? sessions[at].onFrame(frame, peer, now)
              : seals[at].onFrame(frame, peer, now);
        });
  }

  /** The connection is gone. */
  public void endConnection(Peer peer) {
    locked(
        () -> {
          sessions[Medium.STREAM.ordinal()].endConnection(peer);
          return null;
        });
  }

  /** Answers the first frame of a connection for which there is no place. */
  public void turnAway(byte[] frame, Peer peer, long now) {
    locked(
        () -> {
          sessions[Medium.STREAM.ordinal()].turnAway(frame, peer, now);
          return null;
        });
  }

  public long nextTime() {
    return locked(
        () -> {
          long next = grantsDue;
          for (int i = 0; i < sessions.length; ++i) {
            next = Math.min(next, sessions[i].nextTime());
            if (seals[i] != null) {
              next = Math.min(next, seals[i].nextTime());
            }
          }
          return next;
        });
  }

  public void onTime(long now) {
    locked(
        () -> {
          if (now >= grantsDue) {
            grantsDue = now + GrantFile.LOOK_INTERVAL;
            lookAtGrants(now);
          }
          for (int i = 0; i < sessions.length; ++i) {
            sessions[i].onTime(now);
            if (seals[i] != null) {
              seals[i].onTime(now);
            }
          }
          return null;
        });
  }

  // Clients that are admitted no more lose their sessions, and so their streams.
  private void lookAtGrants(long now) {
    Grants fresh = config.grants.look(now);
    if (fresh != grants) {
      grants = fresh;
      for (SealedServer seal : seals) {
        seal.endUnadmitted(now);
      }
    }
  }

  /** How many frames were dropped for a reason. */
  public long dropped(DropReason reason) {
    return locked(
        () -> {
          long count = 0;
          for (int i = 0; i < sessions.length; ++i) {
            count += sessions[i].counters().dropped(reason);
            count += seals[i] == null ? 0 : seals[i].counters().dropped(reason);
          }
          return count;
        });
  }

  // ---- calls: with the lane locked --------------------------------------------------------------

  @Override
  public void onCall(ServerSessions.Request request) {
    ServerSessions of = sessionsOf(request);
    long now = request.received();
    if (request.service() == Limits.SESSION_SERVICE) {
      ObjectTable.Answer answer =
          objects.ofSession(request, of.replySizeMax(request), path -> maySee(of, request, path));
      of.complete(request, answer.status(), answer.payload(), now);
      return;
    }
    ServedObject object = objects.find(request.service());
    Operation<?, ?> operation =
        object == null ? null : object.skeleton.operation(request.method()).orElse(null);
    Status fault = faultOf(of, request, object, operation);
    if (fault != null) {
      refuse(of, request, fault, now);
      return;
    }
    int priority = object.isServerDeclared ? object.priority : request.priority();
    ServedCall call = new ServedCall(this, of, request, operation, priority, ++callCount);
    request.attachment = call;
    queue.add(call);
    hasCall.signal();
  }

  private Grants.Permission permission(
      ServerSessions of, ServerSessions.Request request, String path) {
    if (config.grants == null) {
      return Grants.Permission.ALL;
    }
    SealedServer seal = seals[of == sessions[0] ? 0 : 1];
    byte[] key = seal.clientOf(request.session());
    return key != null && config.trusted.test(key)
        ? Grants.Permission.ALL
        : config.grants.permission(key, request.peer(), path);
  }

  /** Whether the object is there for the request's caller (hp-6.4-2). */
  boolean maySee(ServerSessions of, ServerSessions.Request request, String path) {
    return permission(of, request, path).role() != null;
  }

  // hp-6.4-1
  private Status denial(
      ServerSessions of,
      ServerSessions.Request request,
      ServedObject object,
      Operation<?, ?> operation) {
    Grants.Permission permission = permission(of, request, object.path);
    if (!permission.allows(operation.method().role())) {
      return Status.NOT_ALLOWED;
    }
    return request.priority() > permission.ceiling() ? Status.PRIORITY_NOT_ALLOWED : null;
  }

  private Status faultOf(
      ServerSessions of,
      ServerSessions.Request request,
      ServedObject object,
      Operation<?, ?> operation) {
    if (isStopping) {
      return Status.STOPPING;
    }
    if (object == null) {
      return objects.wasKnown(request.service()) ? Status.GONE : Status.NO_SUCH_OBJECT;
    }
    if (operation == null) {
      return Status.NO_SUCH_METHOD;
    }
    Status denial = denial(of, request, object, operation);
    if (denial != null) {
      return denial;
    }
    boolean isStream = operation.method().kind() == Kind.STREAM;
    if (isStream != request.wantsStream()) {
      return Status.BAD_REQUEST;
    }
    if (operation.method().isTooLarge(request.payload().length)) {
      return Status.TOO_LARGE;
    }
    return queue.size() >= config.queueSizeMax ? Status.OVERLOAD : null;
  }

  private static void refuse(
      ServerSessions of, ServerSessions.Request request, Status status, long now) {
    ++of.counters().refused;
    if (request.wantsReceipt()) {
      of.accept(request, status, now);
    }
    of.complete(request, status, Bytes.NONE, now);
  }

  private ServerSessions sessionsOf(ServerSessions.Request request) {
    for (ServerSessions each : sessions) {
      if (each.isOwn(request)) {
        return each;
      }
    }
    throw new IllegalStateException("a request belongs to a session");
  }

  @Override
  public void onCancelled(ServerSessions.Request request) {
    if (request.attachment instanceof ServedCall call) {
      call.cancel();
      // hp-5.9-2: it must not begin.
      if (queue.remove(call)) {
        call.sessions.complete(request, Status.CANCELLED, Bytes.NONE, System.nanoTime());
      }
    }
  }

  @Override
  public void onCredit(ServerSessions.Request request) {
    if (request.attachment instanceof ServedCall call) {
      call.onCredit();
    }
  }

  // ---- threads ----------------------------------------------------------------------------------

  private void work() {
    for (ServedCall call; (call = take()) != null; ) {
      try {
        call.run();
      } finally {
        locked(
            () -> {
              if (--runningCount == 0) {
                isIdle.signalAll();
              }
              return null;
            });
      }
    }
  }

  private ServedCall take() {
    lock.lock();
    try {
      while (queue.isEmpty()) {
        if (isStopping) {
          return null;
        }
        hasCall.await();
      }
      ++runningCount;
      return queue.poll();
    } catch (InterruptedException e) {
      return null;
    } finally {
      lock.unlock();
    }
  }

  /**
   * Stops: waiting calls end with stopping, running ones may go on for the patience, and then the
   * sessions are closed (hp-4.5-2).
   */
  public void stop(long patienceNs) {
    lock.lock();
    try {
      isStopping = true;
      hasCall.signalAll();
      for (ServedCall call; (call = queue.poll()) != null; ) {
        refuse(call.sessions, call.request, Status.STOPPING, System.nanoTime());
      }
      long left = patienceNs;
      while (runningCount > 0 && left > 0) {
        left = isIdle.awaitNanos(left);
      }
    } catch (InterruptedException e) {
      Thread.currentThread().interrupt();
    } finally {
      lock.unlock();
    }
    locked(
        () -> {
          isStopped = true;
          for (ServerSessions each : sessions) {
            each.closeAll(System.nanoTime());
          }
          return null;
        });
    for (Thread thread : threads) {
      thread.interrupt();
    }
  }

  /** Waits until stopped threads have ended, for the patience at most. */
  public void join(long patienceNs) throws InterruptedException {
    for (Thread thread : threads) {
      thread.join(Math.max(1, TimeUnit.NANOSECONDS.toMillis(patienceNs)));
    }
  }
}
