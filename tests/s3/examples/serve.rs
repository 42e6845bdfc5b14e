//! Serves S3 until the program is ended, for trials by hand: prints the variables that a shell exports, and the bucket.

use yoto_test_s3::{BUCKET, Server};

fn main() {
    let server = Server::start();
    for (name, value) in server.environment() {
        println!("export {name}={value}");
    }
    println!("export YOTO_OBJECTS=s3://{BUCKET}/yoto");
    println!("# the objects are in {}", server.folder().display());
    loop {
        std::thread::park();
    }
}
