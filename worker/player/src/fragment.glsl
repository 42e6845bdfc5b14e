#version 300 es
precision highp float;
flat in vec3 conic;
flat in vec4 paint;
in vec2 offset;
out vec4 pixel;

void main() {
  float power = -0.5 * (conic.x * offset.x * offset.x + conic.z * offset.y * offset.y) - conic.y * offset.x * offset.y;
  float alpha = min(0.99, paint.a * exp(power));
  if (alpha < 1.0 / 255.0) discard;
  pixel = vec4(paint.rgb * alpha, alpha);
}
