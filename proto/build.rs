//! Compiles `yoto/v1/*.proto` and `yoto/worker/v1/*.proto` with protox, so that no `protoc` is needed.

use std::error::Error;
use std::path::PathBuf;
use std::{env, fs};

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=yoto");
    let mut protos: Vec<PathBuf> = Vec::new();
    for package in ["yoto/v1", "yoto/worker/v1"] {
        for entry in fs::read_dir(package)? {
            protos.push(entry?.path());
        }
    }
    protos.sort();
    let descriptors = protox::Compiler::new(["."])?
        .include_source_info(true)
        .include_imports(true)
        .open_files(protos)?
        .encode_file_descriptor_set();
    let out = PathBuf::from(env::var("OUT_DIR")?);
    // Reflection serves these bytes.
    fs::write(out.join("yoto_descriptor.bin"), &descriptors)?;
    let set = prost_types::FileDescriptorSet::decode(descriptors.as_slice())?;
    // A message's full name finds its descriptor, e.g. to write it as JSON.
    let mut config = tonic_prost_build::Config::new();
    config.enable_type_names();
    // Chunks of an upload are not copied out of the messages that brought them.
    config.bytes([".yoto.v1.WriteUploadRequest.chunk"]);
    // They have a secret URL.
    config.skip_debug([
        ".yoto.v1.SignDownloadResponse",
        ".yoto.v1.SignedPart",
        ".yoto.v1.CreateShareResponse",
        ".yoto.v1.CreateWebhookResponse",
    ]);
    tonic_prost_build::configure()
        .client_mod_attribute(".", "#[cfg(feature = \"grpc\")]")
        .server_mod_attribute(".", "#[cfg(feature = \"grpc\")]")
        .compile_fds_with_config(set, config)?;
    Ok(())
}

use prost::Message;
