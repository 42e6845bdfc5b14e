//! Settings of the limits, with their defaults.

use std::time::Duration;
use yoto_proto::limits;

/// Limits of a listener and of each of its connections. [`capacity`](crate::capacity) has the table of who may have how much of them.
#[derive(Debug, Clone)]
pub struct TrafficLimits {
    /// Concurrent connections on which a call was admitted. Each is an open file.
    pub connections: usize,
    /// Concurrent connections on which no call was admitted yet. Each is an open file.
    pub waiting_connections: usize,
    /// Whether the waiting connections of an address, and its calls without a key, have a share. Behind a proxy all have the proxy's address.
    pub by_address: bool,
    /// Maximum time that a connection stays open without a call before the first call that was admitted.
    pub first_call: Duration,
    /// Concurrent calls of all kinds together, with those whose key is being looked up.
    pub calls: usize,
    /// Concurrent calls with the scopes `read` and `write`.
    pub user_calls: usize,
    /// Concurrent calls with the scope `work`.
    pub worker_calls: usize,
    /// Concurrent calls with the scope `operate`.
    pub operator_calls: usize,
    /// Concurrent calls that need no key: pages behind links, the sign-in, the health of gRPC.
    pub open_calls: usize,
    /// Concurrent downloads, which are user calls too. Each is an open file.
    pub downloads: usize,
    /// Concurrent calls on one connection.
    pub connection_calls: u32,
    /// Bytes of requests that are being received or answered, before and after decoding, on all connections.
    pub bytes: u32,
    /// The same on one connection.
    pub connection_bytes: u32,
    /// First bytes of each request that do not count, so that small calls pass whatever others send.
    pub free_bytes: usize,
    /// Maximum length of a message, bytes.
    pub message_bytes: usize,
    /// Maximum size of a decoded message, bytes: a message of a capture's files or of poses takes up to three times its length,
    /// one of empty entries a hundred times. Together with its own bytes it is within those of a connection.
    pub decoded_bytes: usize,
    /// Refused calls of a key that the audit log lists at once. They come back within 10,000 seconds. A tenant has twice as many for
    /// all its keys.
    pub refused_calls: u32,
    /// Maximum wait for the next bytes of a message.
    pub stalled: Duration,
    /// Maximum time from the first byte of a message to its last. The default allows the longest message at 56 kB/s.
    pub message: Duration,
    /// Maximum duration of a unary call.
    pub call: Duration,
    /// Maximum time that a connection stays open without a call.
    pub idle: Duration,
    /// Interval of pings on a connection, and maximum wait for their answer.
    pub ping: Duration,
}

/// Open files of a process on many systems, until it raises its limit.
const FILES: u64 = 1024;

impl TrafficLimits {
    /// The limits of a process that may open as many `files`: connections and calls that hold files get three quarters of them, and
    /// the database, objects that are written and jobs the rest.
    #[must_use]
    pub fn for_files(self, files: u64) -> Self {
        let eighths = |count: u64, most: usize| {
            let part = usize::try_from(files.saturating_mul(count) / 8).unwrap_or(most);
            part.clamp(1, most)
        };
        Self {
            connections: eighths(2, 3072),
            waiting_connections: eighths(1, 1024),
            downloads: eighths(2, 1024),
            open_calls: eighths(1, 512),
            ..self
        }
    }
}

impl Default for TrafficLimits {
    fn default() -> Self {
        let limits = Self {
            by_address: true,
            first_call: Duration::from_secs(10),
            calls: 8192,
            user_calls: 4096,
            worker_calls: 2048,
            operator_calls: 256,
            connection_calls: limits::STREAMS,
            bytes: 16 * limits::MESSAGE_BYTES as u32,
            connection_bytes: 4 * limits::MESSAGE_BYTES as u32,
            free_bytes: 64 << 10,
            message_bytes: limits::MESSAGE_BYTES,
            decoded_bytes: 3 * limits::MESSAGE_BYTES,
            refused_calls: 1000,
            stalled: Duration::from_secs(60),
            message: Duration::from_secs(300),
            call: Duration::from_secs(900),
            idle: Duration::from_secs(300),
            ping: Duration::from_secs(20),
            connections: 0,
            waiting_connections: 0,
            open_calls: 0,
            downloads: 0,
        };
        limits.for_files(FILES)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_holds_files_leaves_a_quarter_of_them() {
        for files in [256, 1024, 65_536, u64::MAX] {
            let limits = TrafficLimits::default().for_files(files);
            let connections = limits.connections + limits.waiting_connections;
            let held = connections + limits.downloads + limits.open_calls;
            assert!(held as u64 <= files / 4 * 3, "{files}: {limits:?}");
        }
        let all = TrafficLimits::default();
        let kinds = all.user_calls + all.worker_calls + all.operator_calls + all.open_calls;
        assert!(kinds < all.calls, "one kind of call can't use up all calls");
    }
}
