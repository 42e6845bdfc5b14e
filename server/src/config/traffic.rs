//! Settings of the limits, with their defaults.

use std::time::Duration;
use yoto_proto::limits;

/// Limits of a listener and of each of its connections.
#[derive(Debug, Clone)]
pub struct TrafficLimits {
    /// Concurrent connections. Each is an open file, of which a process has 1,024 on many systems until it raises its limit, and the database
    /// and objects need some.
    pub connections: usize,
    /// Concurrent calls on all connections.
    pub calls: usize,
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

impl Default for TrafficLimits {
    fn default() -> Self {
        Self {
            connections: 512,
            calls: 4096,
            connection_calls: limits::STREAMS,
            bytes: 16 * limits::MESSAGE_BYTES as u32,
            connection_bytes: 4 * limits::MESSAGE_BYTES as u32,
            free_bytes: 64 << 10,
            message_bytes: limits::MESSAGE_BYTES,
            decoded_bytes: 3 * limits::MESSAGE_BYTES,
            stalled: Duration::from_secs(60),
            message: Duration::from_secs(300),
            call: Duration::from_secs(900),
            idle: Duration::from_secs(300),
            ping: Duration::from_secs(20),
        }
    }
}
