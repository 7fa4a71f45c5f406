/* The kernel's own words for what service/lastopen.py says in numbers: NAME=HEX, one a line. */
#include <linux/gpio.h>
#include <stdio.h>
#include <string.h>

static void show(const char *name, const void *bytes, size_t size)
{
	printf("%s=", name);
	for (size_t i = 0; i < size; i++)
		printf("%02x", ((const unsigned char *)bytes)[i]);
	putchar('\n');
}

static void show_request(const char *name, __u64 more_flags)
{
	struct gpio_v2_line_request request;

	memset(&request, 0, sizeof request);
	request.offsets[0] = 17;
	strcpy(request.consumer, "orchestrator estop");
	request.config.flags = GPIO_V2_LINE_FLAG_OUTPUT | more_flags;
	request.num_lines = 1;
	show(name, &request, sizeof request);
	request.fd = 0x01020304;
	show("granted", &request, sizeof request);
}

int main(void)
{
	struct gpio_v2_line_values values = { .bits = 0, .mask = 1 };
	unsigned int get_line = GPIO_V2_GET_LINE_IOCTL, set_values = GPIO_V2_LINE_SET_VALUES_IOCTL;

	show("get_line", &get_line, sizeof get_line);
	show("set_values", &set_values, sizeof set_values);
	show("open", &values, sizeof values);
	show_request("active_high", 0);
	show_request("active_low", GPIO_V2_LINE_FLAG_ACTIVE_LOW);
	return 0;
}
