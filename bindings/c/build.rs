//! Names the shared library, so that programs find it by its name and not by the path at which it was built.

fn main() {
    println!("cargo::rustc-cdylib-link-arg=-Wl,-soname,libhero_ril.so");
    println!("cargo::rerun-if-changed=build.rs");
}
