#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    ldls_fuzz::diffusion(data);
});
