//! The limits of what clients hold, all in one place.

use std::time::Duration;
use yoto_proto::limits;

/// Limits of a listener and of each of its connections.
#[derive(Debug, Clone)]
pub struct TrafficLimits {
    /// Connections at once. Systems mostly give a process 1024 files, of which the database and the objects need some.
    pub connections: usize,
    /// Calls at once on all connections.
    pub calls: usize,
    /// Calls at once on one connection.
    pub connection_calls: u32,
    /// Bytes of the messages that are arriving or being answered, on all connections.
    pub bytes: u32,
    /// The same on one connection.
    pub connection_bytes: u32,
    /// Beginning of each message that does not count, bytes: small calls pass whatever others send.
    pub free_bytes: usize,
    /// Longest message, bytes.
    pub message_bytes: usize,
    /// Longest wait for the next bytes of a message.
    pub stalled: Duration,
    /// Longest time from the first byte of a message to its last: the longest message at 56 kB/s.
    pub message: Duration,
    /// Longest time of a call with one request and one answer.
    pub call: Duration,
    /// Longest time of a connection without a call.
    pub idle: Duration,
    /// Interval of pings on a connection, and longest wait for their answer.
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
            stalled: Duration::from_secs(60),
            message: Duration::from_secs(300),
            call: Duration::from_secs(900),
            idle: Duration::from_secs(300),
            ping: Duration::from_secs(20),
        }
    }
}
