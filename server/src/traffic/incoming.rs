//! Buffers requests, and passes each message on when it is complete.
//!
//! A gRPC message begins with its length, and tonic reserves that much memory at once. This buffer grows only with the
//! received bytes. They count towards the client's limit until the call is answered or asks for the next message.

use super::held::Held;
use super::{Call, Traffic, busy, decoded};
use bytes::{Buf, Bytes, BytesMut};
use futures::{Stream, stream};
use http_body::Frame;
use http_body_util::{BodyExt, StreamBody};
use std::sync::Arc;
use tokio::time::Instant;
use tonic::Status;
use tonic::body::Body;
use yoto_request::RequestError;

/// Bytes before each message: the compression flag and the length.
const HEADER_BYTES: usize = 5;

/// The requests of a call.
pub(super) struct Incoming {
    pub(super) body: Body,
    pub(super) traffic: Arc<Traffic>,
    pub(super) call: Arc<Call>,
    pub(super) held: Arc<Held>,
    /// Whether the call is unary: the bytes of its message count until it is answered.
    pub(super) single: bool,
    /// Whether the body consists of messages of gRPC. That of a form is passed on as it comes.
    framed: bool,
    /// Full name of the messages' type; `None` if it is not of the contract.
    kind: Option<&'static str>,
    arrived: BytesMut,
    /// Bytes at the front of `arrived` that are complete messages.
    whole: usize,
    /// When the first incomplete message began.
    begun: Option<Instant>,
}

impl Incoming {
    pub(super) fn new(
        body: Body,
        traffic: Arc<Traffic>,
        call: Arc<Call>,
        held: Arc<Held>,
        single: bool,
        framed: bool,
        kind: Option<&'static str>,
    ) -> Self {
        Self {
            body,
            traffic,
            call,
            held,
            single,
            framed,
            kind,
            arrived: BytesMut::new(),
            whole: 0,
            begun: None,
        }
    }

    /// The same messages, each passed on when it is complete.
    pub(super) fn into_body(self) -> Body {
        Body::new(StreamBody::new(self.frames()))
    }

    fn frames(self) -> impl Stream<Item = Result<Frame<Bytes>, Status>> {
        stream::unfold(Some(self), |incoming| async {
            let mut incoming = incoming?;
            match incoming.next().await {
                Ok(Some(bytes)) => Some((Ok(Frame::data(bytes)), Some(incoming))),
                Ok(None) => None,
                Err(status) => Some((Err(status), None)),
            }
        })
    }

    /// The next complete messages; `None` after the last.
    async fn next(&mut self) -> Result<Option<Bytes>, Status> {
        // The caller has processed the previous messages.
        if !self.single {
            self.held.clear();
        }
        while self.whole == 0 {
            let Some(frame) = self.frame().await? else {
                if self.arrived.is_empty() {
                    return Ok(None);
                }
                return Err(Status::invalid_argument("the message is incomplete"));
            };
            // Requests have no trailers in gRPC.
            let Ok(data) = frame.into_data() else {
                continue;
            };
            self.keep(&data)?;
        }
        let whole = self.arrived.split_to(self.whole).freeze();
        self.whole = 0;
        Ok(Some(whole))
    }

    /// The next frame, within the time limits.
    async fn frame(&mut self) -> Result<Option<Frame<Bytes>>, Status> {
        let limits = &self.traffic.limits;
        let stalled = (Instant::now() + limits.stalled, limits.stalled);
        let message = self
            .begun
            .map(|begun| (begun + limits.message, limits.message));
        let (until, limit) = message.map_or(stalled, |message| message.min(stalled));
        match tokio::time::timeout_at(until, self.body.frame()).await {
            Ok(frame) => frame.transpose(),
            Err(_) => {
                let seconds = limit.as_secs_f64();
                let message = format!("the message did not arrive within {seconds} s");
                Err(Status::deadline_exceeded(message))
            }
        }
    }

    /// Appends `data`, and finds the complete messages.
    fn keep(&mut self, data: &[u8]) -> Result<(), Status> {
        let before = self.arrived.len();
        self.count(before, data.len())?;
        self.arrived.extend_from_slice(data);
        if !self.framed {
            // All of it has the time of one message.
            self.begun.get_or_insert_with(Instant::now);
            self.whole = self.arrived.len();
            return Ok(());
        }
        loop {
            let mut rest = &self.arrived[self.whole..];
            if rest.is_empty() {
                self.begun = None;
                return Ok(());
            }
            self.begun.get_or_insert_with(Instant::now);
            if rest.len() < HEADER_BYTES {
                return Ok(());
            }
            rest.advance(1);
            let length = rest.get_u32() as usize;
            let limit = self.traffic.limits.message_bytes;
            if length > limit {
                let message = format!("a message of {length} bytes: at most {limit} are allowed");
                return Err(Status::out_of_range(message));
            }
            if rest.len() < length {
                return Ok(());
            }
            self.weigh(&rest[..length])?;
            self.whole += HEADER_BYTES + length;
            self.begun = None;
        }
    }

    /// Counts the bytes that a complete message takes once it is decoded.
    fn weigh(&self, message: &[u8]) -> Result<(), Status> {
        let Some(kind) = self.kind else {
            return Ok(());
        };
        let most = self.traffic.limits.decoded_bytes;
        let bytes = decoded::bytes(kind, message, most);
        if bytes > most {
            let message = format!(
                "a message of {} bytes takes more than {most} bytes once it is decoded: it has too many entries",
                message.len()
            );
            return Err(Status::out_of_range(message));
        }
        Ok(self.count(0, bytes)?)
    }

    /// Counts the next `coming` bytes, after `before` bytes that were counted.
    fn count(&self, before: usize, coming: usize) -> Result<(), RequestError> {
        let limits = &self.traffic.limits;
        let counted = |bytes: usize| bytes.saturating_sub(limits.free_bytes);
        let more = counted(before + coming) - counted(before);
        let Some(more) = u32::try_from(more).ok().filter(|more| *more > 0) else {
            return Ok(());
        };
        if let Some(client) = self.call.client()
            && !self.held.take_own(&client.bytes, more)
        {
            let limit = limits.connection_bytes;
            return Err(busy(format!(
                "the messages of this connection have more than {limit} bytes together"
            )));
        }
        let all = &self.traffic.pools.bytes;
        let taken = self.held.take_shared(all, self.call.owners(), more);
        taken.map_err(|error| busy(error.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::super::Client;
    use super::*;
    use crate::config::TrafficLimits;
    use futures::channel::mpsc;
    use futures::{FutureExt, StreamExt};
    use std::pin::Pin;
    use std::time::Duration;
    use tonic::Code;
    use yoto_request::Caller;
    use yoto_store::Tenant;

    type Frames = Pin<Box<dyn Stream<Item = Result<Frame<Bytes>, Status>>>>;

    struct Sender(mpsc::UnboundedSender<Result<Frame<Bytes>, Status>>);

    impl Sender {
        fn send(&self, bytes: &[u8]) {
            let frame = Frame::data(Bytes::copy_from_slice(bytes));
            self.0.unbounded_send(Ok(frame)).expect("is read");
        }
    }

    fn client(traffic: &Arc<Traffic>) -> Arc<Client> {
        let place = traffic
            .pools
            .waiting_connections
            .take(&[], 1)
            .expect("has a place");
        Arc::new(traffic.client(None, place, false))
    }

    fn of(traffic: &Arc<Traffic>, client: Option<&Arc<Client>>) -> Arc<Call> {
        Arc::new(Call::begin(Arc::clone(traffic), client.cloned(), None))
    }

    fn call(traffic: &Arc<Traffic>, client: &Arc<Client>, single: bool) -> (Sender, Frames) {
        call_of(traffic, of(traffic, Some(client)), single)
    }

    fn call_of(traffic: &Arc<Traffic>, call: Arc<Call>, single: bool) -> (Sender, Frames) {
        let (sender, receiver) = mpsc::unbounded();
        let body = Body::new(StreamBody::new(receiver));
        let held = Arc::default();
        let incoming = Incoming::new(body, Arc::clone(traffic), call, held, single, true, None);
        (Sender(sender), Box::pin(incoming.frames()))
    }

    #[tokio::test]
    async fn a_form_is_passed_on_as_it_comes_within_the_time_of_one_message() {
        let limits = TrafficLimits {
            message: Duration::ZERO,
            ..TrafficLimits::default()
        };
        let (sender, receiver) = mpsc::unbounded();
        let body = Body::new(StreamBody::new(receiver));
        let held = Arc::default();
        let traffic = Traffic::new(&limits);
        let call = of(&traffic, None);
        let form = Incoming::new(body, traffic, call, held, true, false, None);
        let mut frames: Frames = Box::pin(form.frames());
        let sender = Sender(sender);
        // In messages of gRPC, "token" would begin one of 1.8 GB.
        sender.send(b"token=1&");
        assert_eq!(passed(&mut frames), Some(b"token=1&".to_vec()));
        let late = frames.next().await.expect("an end");
        assert_eq!(late.expect_err("is late").code(), Code::DeadlineExceeded);
    }

    fn message(bytes: &[u8]) -> Vec<u8> {
        let length = u32::try_from(bytes.len()).expect("is short");
        [&[0][..], &length.to_be_bytes(), bytes].concat()
    }

    fn passed(frames: &mut Frames) -> Option<Vec<u8>> {
        let next = frames.next().now_or_never()?;
        let frame = next.expect("goes on").expect("is good");
        Some(frame.into_data().expect("is data").to_vec())
    }

    async fn refused(frames: &mut Frames) -> Status {
        let next = frames.next().await.expect("an answer");
        next.expect_err("is refused")
    }

    #[tokio::test]
    async fn a_message_is_passed_on_when_it_is_complete() {
        let traffic = Traffic::new(&TrafficLimits::default());
        let (sender, mut frames) = call(&traffic, &client(&traffic), false);
        let [first, second] = [message(b"hello"), message(b"")];
        sender.send(&first[..7]);
        assert_eq!(passed(&mut frames), None, "it is incomplete");
        sender.send(&[&first[7..], &second[..3]].concat());
        assert_eq!(passed(&mut frames), Some(first.clone()));
        sender.send(&[&second[3..], &first[..]].concat());
        assert_eq!(passed(&mut frames), Some([second, first.clone()].concat()));
        sender.send(&first[..6]);
        drop(sender);
        assert_eq!(refused(&mut frames).await.code(), Code::InvalidArgument);
        assert!(frames.next().await.is_none());
    }

    #[tokio::test]
    async fn an_announced_length_takes_no_memory() {
        let traffic = Traffic::new(&TrafficLimits::default());
        let body = Body::new(StreamBody::new(stream::pending::<Result<_, Status>>()));
        let call = of(&traffic, None);
        let mut incoming = Incoming::new(body, traffic, call, Arc::default(), true, true, None);
        let length = u32::try_from(incoming.traffic.limits.message_bytes).expect("fits");
        incoming.keep(&[0]).expect("is kept");
        incoming.keep(&length.to_be_bytes()).expect("is kept");
        assert!(incoming.arrived.capacity() < 1024);
        assert_eq!(incoming.whole, 0);
        let mut longer = message(b"");
        longer[1..].copy_from_slice(&(length + 1).to_be_bytes());
        incoming.arrived.clear();
        let status = incoming.keep(&longer).expect_err("is too long");
        assert_eq!(status.code(), Code::OutOfRange);
    }

    #[tokio::test]
    async fn bytes_beyond_the_limits_are_refused_and_small_calls_pass() {
        let traffic = Traffic::new(&TrafficLimits {
            free_bytes: 10,
            connection_bytes: 100,
            bytes: 150,
            ..TrafficLimits::default()
        });
        let clients = [(); 2].map(|()| client(&traffic));
        let (large, small) = (message(&[1; 85]), message(b"small"));
        // 80 of them count.
        let (sender, mut first) = call(&traffic, &clients[0], true);
        sender.send(&large);
        assert!(passed(&mut first).is_some());
        // Of the same client, and of another one.
        for client in &clients {
            let (sender, mut frames) = call(&traffic, client, true);
            sender.send(&large);
            assert_eq!(refused(&mut frames).await.code(), Code::Unavailable);
            let (sender, mut frames) = call(&traffic, client, true);
            sender.send(&small);
            assert!(passed(&mut frames).is_some());
        }
        // An answered call no longer counts.
        drop(first);
        let (sender, mut frames) = call(&traffic, &clients[1], true);
        sender.send(&large);
        assert!(passed(&mut frames).is_some());
    }

    #[tokio::test]
    async fn a_tenant_has_a_share_of_the_bytes_on_all_its_connections() {
        let traffic = Traffic::new(&TrafficLimits {
            free_bytes: 0,
            bytes: 200,
            ..TrafficLimits::default()
        });
        let of_tenant = |name: &str| {
            let call = of(&traffic, Some(&client(&traffic)));
            let caller = Caller::trusted(Tenant::new(name).expect("a tenant"));
            call.admitted(&caller, None, false).expect("has a place");
            call_of(&traffic, call, true)
        };
        let large = message(&[1; 75]);
        let (sender, mut first) = of_tenant("greedy");
        sender.send(&large);
        assert!(passed(&mut first).is_some());
        let (sender, mut second) = of_tenant("greedy");
        sender.send(&large);
        assert_eq!(refused(&mut second).await.code(), Code::Unavailable);
        let (sender, mut other) = of_tenant("other");
        sender.send(&message(&[1; 50]));
        assert!(passed(&mut other).is_some());
    }

    #[tokio::test]
    async fn the_messages_of_a_stream_count_one_by_one() {
        let traffic = Traffic::new(&TrafficLimits {
            free_bytes: 0,
            connection_bytes: 100,
            ..TrafficLimits::default()
        });
        let client = client(&traffic);
        let (sender, mut frames) = call(&traffic, &client, false);
        for _ in 0..5 {
            sender.send(&message(&[1; 80]));
            assert!(passed(&mut frames).is_some());
        }
    }

    #[tokio::test]
    async fn a_message_that_stalls_or_trickles_ends() {
        let short = Duration::from_millis(5);
        let traffic = Traffic::new(&TrafficLimits {
            stalled: short,
            ..TrafficLimits::default()
        });
        let (sender, mut frames) = call(&traffic, &client(&traffic), false);
        assert_eq!(refused(&mut frames).await.code(), Code::DeadlineExceeded);
        drop(sender);
        let traffic = Traffic::new(&TrafficLimits {
            message: short,
            ..TrafficLimits::default()
        });
        let (sender, mut frames) = call(&traffic, &client(&traffic), false);
        sender.send(&message(b"hello")[..7]);
        assert_eq!(refused(&mut frames).await.code(), Code::DeadlineExceeded);
        drop(sender);
    }
}
