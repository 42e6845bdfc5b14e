"""Makes the clips of the video tests: 20 frames of 50x38 pixels at 15 a second.

Frame i is one colour, (20 + 10 i, 100, 210 - 10 i), with a white bar of 6 columns from column
2 i, so that order, colour and turn can be told. Needs an ffmpeg with x264, x265 and zimg (zscale):

    python3 make.py path/to/ffmpeg
"""

import subprocess
import sys

WIDTH, HEIGHT, FRAMES = 50, 38, 20


def frame(i):
    row = b"".join(
        bytes([255, 255, 255] if 2 * i <= x < 2 * i + 6 else [20 + 10 * i, 100, 210 - 10 * i])
        for x in range(WIDTH)
    )
    return row * HEIGHT


RAW = b"".join(frame(i) for i in range(FRAMES))


def make(name, *options, source=()):
    command = [sys.argv[1], "-y", "-v", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]
    command += ["-s", f"{WIDTH}x{HEIGHT}", "-r", "15", "-i", "pipe:0", *options, "-bitexact", name]
    subprocess.run(command, input=RAW, check=True)


X264 = ["-c:v", "libx264", "-crf", "8", "-pix_fmt", "yuv420p"]
B_FRAMES = ["-x264-params", "bframes=3:b-adapt=0:b-pyramid=normal:keyint=12"]
make("b_frames.mp4", *X264, *B_FRAMES)
make("b_frames.mov", *X264, *B_FRAMES)
make("baseline.mp4", *X264, "-profile:v", "baseline")
make("fragmented.mp4", *X264, *B_FRAMES, "-movflags", "frag_keyframe+empty_moov+default_base_moof")
# Five frames at 15 a second, then a pause of three frames, and so on.
PAUSES = ["-vf", "setpts=(N+floor(N/5)*3)/15/TB", "-fps_mode", "passthrough"]
make("pauses.mp4", *X264, *B_FRAMES, *PAUSES)
make("yuv422.mp4", "-c:v", "libx264", "-crf", "8", "-pix_fmt", "yuv422p")
make("hevc.mp4", "-c:v", "libx265", "-crf", "8", "-pix_fmt", "yuv420p", "-tag:v", "hvc1", "-x265-params", "log-level=error")
make("mjpeg.avi", "-c:v", "mjpeg", "-q:v", "2")
# A codec of screens, which no camera writes.
make("flashsv.mkv", "-c:v", "flashsv")
turn = [sys.argv[1], "-y", "-v", "error", "-display_rotation", "-90", "-i", "b_frames.mp4"]
subprocess.run([*turn, "-c", "copy", "-bitexact", "turned_right.mp4"], check=True)

# HDR as a camera writes it, of the same colours: diffuse white at 203 cd/m2.
def hdr(transfer):
    light = f"zscale=pin=709:tin=709:min=gbr:rin=full:p=2020:t={transfer}:m=2020_ncl:r=limited:npl=203:agamma=0"
    return ["-vf", f"format=gbrp,{light},format=FORMAT", "-colorspace", "bt2020nc", "-color_primaries", "bt2020", "-color_trc", transfer]


def depth(options, pixels):
    return [option.replace("FORMAT", pixels) for option in options]


X265 = ["-c:v", "libx265", "-crf", "6", "-tag:v", "hvc1"]
make("hlg.mp4", "-c:v", "libx264", "-crf", "6", *depth(hdr("arib-std-b67"), "yuv420p"))
make("hlg_hevc.mov", *X265, "-x265-params", "log-level=error", *depth(hdr("arib-std-b67"), "yuv420p10le"))
make("pq_hevc.mp4", *X265, "-x265-params", "log-level=error", *depth(hdr("smpte2084"), "yuv420p10le"))
# Ordinary levels that are declared to be HLG.
DECLARED = ["-vf", "scale=out_color_matrix=bt2020,format=yuv420p,setparams=color_trc=arib-std-b67:color_primaries=bt2020:colorspace=bt2020nc"]
make("declared_hlg.mp4", "-c:v", "libx264", "-crf", "6", *DECLARED)
# Pixels about twice as wide as high.
WIDE = ["-vf", "scale=26:38:flags=area,setsar=50/26"]
make("wide_pixels.mp4", *X264, *WIDE)
make("wide_pixels.avi", "-c:v", "mjpeg", "-q:v", "2", *WIDE)
turn = [sys.argv[1], "-y", "-v", "error", "-display_rotation", "-90", "-i", "wide_pixels.mp4"]
subprocess.run([*turn, "-c", "copy", "-bitexact", "wide_pixels_turned.mp4"], check=True)
# The same stream in a container that ffmpeg reads.
remux = [sys.argv[1], "-y", "-v", "error", "-i", "hlg.mp4", "-c", "copy", "-bitexact", "hlg.mkv"]
subprocess.run(remux, check=True)
