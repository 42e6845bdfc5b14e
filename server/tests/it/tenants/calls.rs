//! Calls of methods that are known by their descriptors only.

use bytes::{Buf, BufMut};
use prost::Message;
use prost_reflect::{DynamicMessage, MethodDescriptor};
use tonic::codec::{Codec, DecodeBuf, Decoder, EncodeBuf, Encoder};
use tonic::codegen::http::uri::PathAndQuery;
use tonic::{Code, Request, Status};
use yoto_proto::key::Connection;

/// What a caller learns from a call.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Answer {
    pub code: Code,
    pub message: String,
    /// The error's details, or the encoded first response.
    bytes: Vec<u8>,
}

impl Answer {
    /// The answer with the id in `name` blotted out.
    pub(crate) fn without(&self, name: &str) -> (Code, String, String) {
        let id = super::requests::id(name);
        let bytes = String::from_utf8_lossy(&self.bytes).replace(id, "ID");
        (self.code, self.message.replace(id, "ID"), bytes)
    }

    /// Whether it contains `id` anywhere.
    pub(crate) fn holds(&self, id: &str) -> bool {
        self.message.contains(id) || String::from_utf8_lossy(&self.bytes).contains(id)
    }
}

/// Calls `method` with one message. All calls are made as streams in both directions, which is the same on the wire.
pub(crate) async fn call(
    connection: Connection,
    method: &MethodDescriptor,
    request: &DynamicMessage,
) -> Answer {
    let path = format!("/{}/{}", method.parent_service().full_name(), method.name());
    call_path(connection, &path, request.encode_to_vec()).await
}

/// The same by the method's path.
pub(crate) async fn call_path(connection: Connection, path: &str, request: Vec<u8>) -> Answer {
    let path = PathAndQuery::try_from(path).expect("a path");
    let request = Request::new(tokio_stream::once(request));
    let mut grpc = tonic::client::Grpc::new(connection);
    grpc.ready().await.expect("connects");
    let first = async {
        let answers = grpc.streaming(request, path, Bytes).await?;
        answers.into_inner().message().await
    };
    match first.await {
        Ok(answer) => Answer {
            code: Code::Ok,
            message: String::new(),
            bytes: answer.unwrap_or_default(),
        },
        Err(status) => Answer {
            code: status.code(),
            message: status.message().to_owned(),
            bytes: status.details().to_vec(),
        },
    }
}

/// Messages as they are encoded.
struct Bytes;

impl Codec for Bytes {
    type Encode = Vec<u8>;
    type Decode = Vec<u8>;
    type Encoder = Self;
    type Decoder = Self;

    fn encoder(&mut self) -> Self {
        Self
    }

    fn decoder(&mut self) -> Self {
        Self
    }
}

impl Encoder for Bytes {
    type Item = Vec<u8>;
    type Error = Status;

    fn encode(&mut self, item: Vec<u8>, buffer: &mut EncodeBuf<'_>) -> Result<(), Status> {
        buffer.put_slice(&item);
        Ok(())
    }
}

impl Decoder for Bytes {
    type Item = Vec<u8>;
    type Error = Status;

    fn decode(&mut self, buffer: &mut DecodeBuf<'_>) -> Result<Option<Vec<u8>>, Status> {
        let mut bytes = vec![0; buffer.remaining()];
        buffer.copy_to_slice(&mut bytes);
        Ok(Some(bytes))
    }
}
